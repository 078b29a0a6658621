// Compiles a Kaitai Struct description: node kaitai.mjs LANGUAGE < strivec.ksy > parser

import { readFileSync } from "node:fs";

import Compiler from "kaitai-struct-compiler";
import { parse } from "yaml";

const files = await Compiler.compile(process.argv[2], parse(readFileSync(0, "utf8")), null, false);
process.stdout.write(Object.values(files).join("\n"));
