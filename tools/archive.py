#!/usr/bin/env python3
"""Packs files into an archive whose bytes depend on their names and contents alone.

    python3 tools/archive.py strivec-0.1.0-TARGET.tar.gz strivec README.md ...

The ending of the name chooses the format, .tar.gz or .zip. Files lie in a folder that is named like the archive, without
their own folders. Those without an ending, or with .exe, are executable.
"""

import gzip
import io
import sys
import tarfile
import zipfile
from pathlib import Path

ENDINGS = (".tar.gz", ".zip")
# The first day that a zip file can express.
DATE = (1980, 1, 1, 0, 0, 0)
SECONDS = 315532800


def mode(name: str) -> int:
    """Permissions of a file; LICENSE-MIT and the like are texts."""
    is_program = Path(name).suffix in ("", ".exe") and not name.startswith("LICENSE")
    return 0o755 if is_program else 0o644


def tar_gz(folder: str, files: list[Path]) -> bytes:
    """A compressed tar archive."""
    plain = io.BytesIO()
    with tarfile.open(fileobj=plain, mode="w", format=tarfile.USTAR_FORMAT) as archive:
        for file in files:
            entry = tarfile.TarInfo(f"{folder}/{file.name}")
            entry.size, entry.mode, entry.mtime = file.stat().st_size, mode(file.name), SECONDS
            with file.open("rb") as content:
                archive.addfile(entry, content)
    packed = io.BytesIO()
    with gzip.GzipFile(filename="", fileobj=packed, mode="wb", mtime=SECONDS) as stream:
        stream.write(plain.getvalue())
    return packed.getvalue()


def zipped(folder: str, files: list[Path]) -> bytes:
    """A zip archive."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in files:
            entry = zipfile.ZipInfo(f"{folder}/{file.name}", DATE)
            entry.compress_type, entry.create_system = zipfile.ZIP_DEFLATED, 3
            entry.external_attr = (0o100000 | mode(file.name)) << 16
            archive.writestr(entry, file.read_bytes())
    return packed.getvalue()


def main(output: Path, files: list[Path]) -> int:
    ending = next((ending for ending in ENDINGS if output.name.endswith(ending)), None)
    if ending is None:
        print(f"archive: {output}: expected a name that ends in {' or '.join(ENDINGS)}", file=sys.stderr)
        return 1
    folder, files = output.name.removesuffix(ending), sorted(files, key=lambda file: file.name)
    output.write_bytes(zipped(folder, files) if ending == ".zip" else tar_gz(folder, files))
    return 0


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    sys.exit(main(Path(sys.argv[1]), [Path(name) for name in sys.argv[2:]]))
