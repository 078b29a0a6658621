//! The instructions of pickles, named as in Python's `pickletools`.

use std::ops::Range;

use super::{Id, MAX_NAME, Machine, NEWEST_PROTOCOL, Value};
use strivec_import::Fault;

const PROTO: u8 = 0x80;
const FRAME: u8 = 0x95;
const STOP: u8 = b'.';
const POP: u8 = b'0';
const POP_MARK: u8 = b'1';
const MARK: u8 = b'(';

const NONE: u8 = b'N';
const NEWTRUE: u8 = 0x88;
const NEWFALSE: u8 = 0x89;
const BININT: u8 = b'J';
const BININT1: u8 = b'K';
const BININT2: u8 = b'M';
const LONG1: u8 = 0x8a;
const BINFLOAT: u8 = b'G';
const BINUNICODE: u8 = b'X';
const SHORT_BINUNICODE: u8 = 0x8c;
const BINUNICODE8: u8 = 0x8d;
const BINBYTES: u8 = b'B';
const SHORT_BINBYTES: u8 = b'C';
const BINBYTES8: u8 = 0x8e;
const BYTEARRAY8: u8 = 0x96;

const EMPTY_TUPLE: u8 = b')';
const EMPTY_LIST: u8 = b']';
const EMPTY_DICT: u8 = b'}';
const TUPLE1: u8 = 0x85;
const TUPLE2: u8 = 0x86;
const TUPLE3: u8 = 0x87;
const TUPLE: u8 = b't';
const LIST: u8 = b'l';
const DICT: u8 = b'd';
const APPEND: u8 = b'a';
const APPENDS: u8 = b'e';
const SETITEM: u8 = b's';
const SETITEMS: u8 = b'u';

const BINPUT: u8 = b'q';
const LONG_BINPUT: u8 = b'r';
const MEMOIZE: u8 = 0x94;
const BINGET: u8 = b'h';
const LONG_BINGET: u8 = b'j';

const GLOBAL: u8 = b'c';
const STACK_GLOBAL: u8 = 0x93;
const REDUCE: u8 = b'R';
const NEWOBJ: u8 = 0x81;
const BUILD: u8 = b'b';
const BINPERSID: u8 = b'Q';

impl Machine<'_> {
    /// Runs one instruction. Returns true after the last one.
    pub(super) fn step(&mut self) -> Result<bool, Fault> {
        let code = self.u8()?;
        if code == STOP {
            return Ok(true);
        }
        let known = self.constant(code)? || self.container(code)? || self.memo(code)? || self.object(code)?;
        if !known {
            self.control(code)?;
        }
        Ok(false)
    }

    /// The protocol, frames and the stack; all other instructions are errors.
    fn control(&mut self, code: u8) -> Result<(), Fault> {
        match code {
            PROTO => {
                let version = self.u8()?;
                if version > NEWEST_PROTOCOL {
                    return Err(self.malformed("a protocol of 2 to 5", version));
                }
            }
            FRAME => {
                self.take(8)?;
            }
            POP => drop(self.pop()?),
            POP_MARK => drop(self.pop_mark()?),
            MARK => self.marks.push(self.stack.len()),
            other => return Err(self.malformed("an instruction of torch's pickles", format!("{other:#04x}"))),
        }
        Ok(())
    }

    /// Pushes a constant. Returns false, as the three functions below, for other instructions.
    fn constant(&mut self, code: u8) -> Result<bool, Fault> {
        let value = match code {
            NONE => Value::Opaque,
            NEWTRUE => Value::Bool(true),
            NEWFALSE => Value::Bool(false),
            BININT => Value::Int(i32::from_le_bytes(self.array()?).into()),
            BININT1 => Value::Int(self.u8()?.into()),
            BININT2 => Value::Int(u16::from_le_bytes(self.array()?).into()),
            LONG1 => self.long()?,
            BINFLOAT => Value::Float(f64::from_be_bytes(self.array()?)),
            BINUNICODE => self.text(4)?,
            SHORT_BINUNICODE => self.text(1)?,
            BINUNICODE8 => self.text(8)?,
            BINBYTES => Value::Bytes(self.counted(4)?),
            SHORT_BINBYTES => Value::Bytes(self.counted(1)?),
            BINBYTES8 | BYTEARRAY8 => Value::Bytes(self.counted(8)?),
            _ => return Ok(false),
        };
        self.push(value)?;
        Ok(true)
    }

    /// Creates or extends a tuple, list or dictionary.
    fn container(&mut self, code: u8) -> Result<bool, Fault> {
        match code {
            EMPTY_TUPLE | EMPTY_LIST => self.push(Value::Items(Vec::new()))?,
            EMPTY_DICT => self.push(Value::Dict(Vec::new()))?,
            TUPLE1 | TUPLE2 | TUPLE3 => {
                let items = self.pop_some(usize::from(code - TUPLE1) + 1)?;
                self.push(Value::Items(items))?;
            }
            TUPLE | LIST => {
                let items = self.pop_mark()?;
                self.push(Value::Items(items))?;
            }
            DICT => {
                let items = self.pop_mark()?;
                let pairs = self.pairs(items)?;
                self.push(Value::Dict(pairs))?;
            }
            APPEND => {
                let item = self.pop()?;
                self.extend(vec![item])?;
            }
            APPENDS => {
                let items = self.pop_mark()?;
                self.extend(items)?;
            }
            SETITEM => {
                let items = self.pop_some(2)?;
                self.set(items)?;
            }
            SETITEMS => {
                let items = self.pop_mark()?;
                self.set(items)?;
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Stores the top of the stack in the memo, or pushes a value from there.
    fn memo(&mut self, code: u8) -> Result<bool, Fault> {
        let key = match code {
            BINPUT | BINGET => self.u8()?.into(),
            LONG_BINPUT | LONG_BINGET => u32::from_le_bytes(self.array()?),
            MEMOIZE => self.memo.len() as u32,
            _ => return Ok(false),
        };
        if matches!(code, BINGET | LONG_BINGET) {
            self.recall(key)?;
        } else {
            self.memoize(key)?;
        }
        Ok(true)
    }

    /// Names a function or class, calls it, or sets the state of an object.
    fn object(&mut self, code: u8) -> Result<bool, Fault> {
        match code {
            GLOBAL => {
                let (module, name) = (self.line()?, self.line()?);
                self.global(module, name)?;
            }
            STACK_GLOBAL => {
                let texts = self.pop_some(2)?;
                let [module, name] = [texts[0], texts[1]].map(|id| self.range_of_text(id));
                self.global(module?, name?)?;
            }
            REDUCE | NEWOBJ => {
                let both = self.pop_some(2)?;
                self.call(both[0], both[1])?;
            }
            BUILD => {
                let state = self.pop()?;
                self.build(state)?;
            }
            BINPERSID => {
                let id = self.pop()?;
                let storage = self.storage(id)?;
                self.push(storage)?;
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn memoize(&mut self, key: u32) -> Result<(), Fault> {
        let id = self.top()?;
        self.memo.insert(key, id);
        Ok(())
    }

    fn recall(&mut self, key: u32) -> Result<(), Fault> {
        let id = self.memo.get(&key).copied();
        self.stack.push(id.ok_or_else(|| self.malformed("a memoized value", format!("number {key}")))?);
        Ok(())
    }

    /// An integer of any size; opaque if it exceeds 64 bits.
    fn long(&mut self) -> Result<Value, Fault> {
        let length = usize::from(self.u8()?);
        let range = self.take(length)?;
        let bytes = &self.bytes[range];
        Ok(match bytes {
            [.., last] if length <= 8 => {
                let mut eight = [if *last >= 0x80 { 0xff } else { 0 }; 8];
                eight[..length].copy_from_slice(bytes);
                Value::Int(i64::from_le_bytes(eight))
            }
            [] => Value::Int(0),
            _ => Value::Opaque,
        })
    }

    /// UTF-8 behind a length of `width` bytes.
    fn text(&mut self, width: usize) -> Result<Value, Fault> {
        let range = self.counted(width)?;
        if std::str::from_utf8(&self.bytes[range.clone()]).is_err() {
            return Err(self.malformed("UTF-8", "other bytes"));
        }
        Ok(Value::Text(range))
    }

    /// Bytes behind a length of `width` bytes.
    fn counted(&mut self, width: usize) -> Result<Range<usize>, Fault> {
        let mut eight = [0; 8];
        let range = self.take(width)?;
        eight[..width].copy_from_slice(&self.bytes[range]);
        let length = u64::from_le_bytes(eight);
        self.take(usize::try_from(length).unwrap_or(usize::MAX))
    }

    /// A name, up to the end of its line.
    fn line(&mut self) -> Result<Range<usize>, Fault> {
        let rest = &self.bytes[self.at..];
        let length = rest.iter().take(MAX_NAME + 1).position(|&b| b == b'\n');
        let length = length.ok_or_else(|| self.malformed("a name of at most 256 bytes and its line's end", "none"))?;
        let range = self.take(length)?;
        self.take(1)?;
        Ok(range)
    }

    fn extend(&mut self, more: Vec<Id>) -> Result<(), Fault> {
        let on = self.top()?;
        match &mut self.values[on as usize] {
            Value::Items(items) => items.extend(more),
            _ => return Err(self.malformed("a list to append to", "something else")),
        }
        Ok(())
    }

    fn set(&mut self, items: Vec<Id>) -> Result<(), Fault> {
        let more = self.pairs(items)?;
        let on = self.top()?;
        match &mut self.values[on as usize] {
            Value::Dict(pairs) => pairs.extend(more),
            _ => return Err(self.malformed("a dictionary to set items of", "something else")),
        }
        Ok(())
    }

    fn pairs(&self, items: Vec<Id>) -> Result<Vec<(Id, Id)>, Fault> {
        if !items.len().is_multiple_of(2) {
            return Err(self.malformed("pairs of a key and a value", format!("{} items", items.len())));
        }
        Ok(items.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect())
    }
}
