//! The stack machine that a pickle is a program of, without those instructions that would run anything.

mod made;

use std::collections::HashMap;
use std::ops::Range;

use super::value::{Id, Value};
use crate::import::Fault;

/// The most instructions that are followed.
const MAX_STEPS: u64 = 1 << 22;
/// The most values.
const MAX_VALUES: u64 = 1 << 20;
/// The longest name of a function or its module.
const MAX_NAME: usize = 256;
/// The newest protocol.
const NEWEST: u8 = 5;

struct Machine<'a> {
    name: &'a str,
    bytes: &'a [u8],
    /// Where the next byte is.
    at: usize,
    /// Where the instruction is that is followed.
    instruction: usize,
    values: Vec<Value>,
    stack: Vec<Id>,
    /// Heights of the stack.
    marks: Vec<usize>,
    memo: HashMap<u32, Id>,
}

/// The values of the pickle `bytes`, and which of them it is of.
pub(super) fn run(bytes: &[u8], name: &str) -> Result<(Vec<Value>, Id), Fault> {
    let mut machine = Machine {
        name,
        bytes,
        at: 0,
        instruction: 0,
        values: Vec::new(),
        stack: Vec::new(),
        marks: Vec::new(),
        memo: HashMap::new(),
    };
    for step in 0.. {
        Fault::unless_within("instructions of a pickle", MAX_STEPS, step)?;
        machine.instruction = machine.at;
        if machine.step()? {
            break;
        }
    }
    let root = machine.pop()?;
    if machine.at != bytes.len() {
        return Err(machine.malformed("the end of the pickle", format!("{} bytes", bytes.len() - machine.at)));
    }
    Ok((machine.values, root))
}

impl Machine<'_> {
    /// Follows one instruction; whether it was the last.
    fn step(&mut self) -> Result<bool, Fault> {
        match self.u8()? {
            // PROTO, FRAME
            0x80 => {
                let version = self.u8()?;
                if version > NEWEST {
                    return Err(self.malformed("a protocol of 2 to 5", version));
                }
            }
            0x95 => {
                self.take(8)?;
            }
            b'.' => return Ok(true),
            // POP, POP_MARK, MARK
            b'0' => {
                self.pop()?;
            }
            b'1' => {
                self.pop_mark()?;
            }
            b'(' => self.marks.push(self.stack.len()),
            b'N' => self.push(Value::Opaque)?,
            // NEWTRUE, NEWFALSE
            0x88 => self.push(Value::Bool(true))?,
            0x89 => self.push(Value::Bool(false))?,
            // BININT, BININT1, BININT2, LONG1, BINFLOAT
            b'J' => {
                let value = i32::from_le_bytes(self.array()?);
                self.push(Value::Int(value.into()))?;
            }
            b'K' => {
                let value = self.u8()?;
                self.push(Value::Int(value.into()))?;
            }
            b'M' => {
                let value = u16::from_le_bytes(self.array()?);
                self.push(Value::Int(value.into()))?;
            }
            0x8a => self.long()?,
            b'G' => {
                let value = f64::from_be_bytes(self.array()?);
                self.push(Value::Float(value))?;
            }
            // BINUNICODE, SHORT_BINUNICODE, BINUNICODE8
            b'X' => self.text(4)?,
            0x8c => self.text(1)?,
            0x8d => self.text(8)?,
            // BINBYTES, SHORT_BINBYTES, BINBYTES8, BYTEARRAY8
            b'B' => self.binary(4)?,
            b'C' => self.binary(1)?,
            0x8e | 0x96 => self.binary(8)?,
            // EMPTY_TUPLE, EMPTY_LIST, EMPTY_DICT
            b')' | b']' => self.push(Value::Items(Vec::new()))?,
            b'}' => self.push(Value::Dict(Vec::new()))?,
            // TUPLE1 to TUPLE3, TUPLE, LIST, DICT
            number @ 0x85..=0x87 => {
                let items = self.pop_some(usize::from(number - 0x84))?;
                self.push(Value::Items(items))?;
            }
            b't' | b'l' => {
                let items = self.pop_mark()?;
                self.push(Value::Items(items))?;
            }
            b'd' => {
                let items = self.pop_mark()?;
                let pairs = self.pairs(items)?;
                self.push(Value::Dict(pairs))?;
            }
            // APPEND, APPENDS, SETITEM, SETITEMS
            b'a' => {
                let item = self.pop()?;
                self.extend(vec![item])?;
            }
            b'e' => {
                let items = self.pop_mark()?;
                self.extend(items)?;
            }
            b's' => {
                let items = self.pop_some(2)?;
                self.set(items)?;
            }
            b'u' => {
                let items = self.pop_mark()?;
                self.set(items)?;
            }
            // BINPUT, LONG_BINPUT, MEMOIZE, BINGET, LONG_BINGET
            b'q' => {
                let key = self.u8()?.into();
                self.memoize(key)?;
            }
            b'r' => {
                let key = u32::from_le_bytes(self.array()?);
                self.memoize(key)?;
            }
            0x94 => self.memoize(self.memo.len() as u32)?,
            b'h' => {
                let key = self.u8()?.into();
                self.recall(key)?;
            }
            b'j' => {
                let key = u32::from_le_bytes(self.array()?);
                self.recall(key)?;
            }
            // GLOBAL, STACK_GLOBAL
            b'c' => {
                let (module, name) = (self.line()?, self.line()?);
                self.global(module, name)?;
            }
            0x93 => {
                let texts = self.pop_some(2)?;
                let [module, name] = [texts[0], texts[1]].map(|id| self.range_of_text(id));
                self.global(module?, name?)?;
            }
            // REDUCE, NEWOBJ, BUILD, BINPERSID
            b'R' | 0x81 => {
                let both = self.pop_some(2)?;
                self.call(both[0], both[1])?;
            }
            b'b' => {
                let state = self.pop()?;
                self.build(state)?;
            }
            b'Q' => {
                let id = self.pop()?;
                let storage = self.storage(id)?;
                self.push(storage)?;
            }
            other => return Err(self.malformed("an instruction of torch's pickles", format!("{other:#04x}"))),
        }
        Ok(false)
    }

    fn memoize(&mut self, key: u32) -> Result<(), Fault> {
        let id = self.top()?;
        self.memo.insert(key, id);
        Ok(())
    }

    fn recall(&mut self, key: u32) -> Result<(), Fault> {
        let id = self.memo.get(&key).copied();
        self.stack.push(id.ok_or_else(|| self.malformed("a value that was memorised", format!("number {key}")))?);
        Ok(())
    }

    /// LONG1: integers of any size, of which those of 64 bits are of use.
    fn long(&mut self) -> Result<(), Fault> {
        let length = usize::from(self.u8()?);
        let range = self.take(length)?;
        let bytes = &self.bytes[range];
        let value = match bytes {
            [.., last] if length <= 8 => {
                let mut eight = [if *last >= 0x80 { 0xff } else { 0 }; 8];
                eight[..length].copy_from_slice(bytes);
                Value::Int(i64::from_le_bytes(eight))
            }
            [] => Value::Int(0),
            _ => Value::Opaque,
        };
        self.push(value)
    }

    fn text(&mut self, width: usize) -> Result<(), Fault> {
        let range = self.counted(width)?;
        if std::str::from_utf8(&self.bytes[range.clone()]).is_err() {
            return Err(self.malformed("UTF-8", "bytes that are none"));
        }
        self.push(Value::Text(range))
    }

    fn binary(&mut self, width: usize) -> Result<(), Fault> {
        let range = self.counted(width)?;
        self.push(Value::Bytes(range))
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
            return Err(self.malformed("keys and values", format!("{} of them", items.len())));
        }
        Ok(items.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect())
    }

    fn value(&self, id: Id) -> &Value {
        &self.values[id as usize]
    }

    fn add(&mut self, value: Value) -> Result<Id, Fault> {
        Fault::unless_within("values of a pickle", MAX_VALUES, self.values.len() as u64 + 1)?;
        self.values.push(value);
        Ok(self.values.len() as Id - 1)
    }

    fn push(&mut self, value: Value) -> Result<(), Fault> {
        let id = self.add(value)?;
        self.stack.push(id);
        Ok(())
    }

    /// Values above the last mark.
    fn available(&self) -> usize {
        self.stack.len() - self.marks.last().copied().unwrap_or(0)
    }

    fn top(&self) -> Result<Id, Fault> {
        self.stack.last().copied().ok_or_else(|| self.malformed("a value on the stack", "none"))
    }

    fn pop(&mut self) -> Result<Id, Fault> {
        Ok(self.pop_some(1)?[0])
    }

    fn pop_some(&mut self, count: usize) -> Result<Vec<Id>, Fault> {
        if self.available() < count {
            return Err(self.malformed(&format!("{count} values on the stack"), self.available()));
        }
        Ok(self.stack.split_off(self.stack.len() - count))
    }

    fn pop_mark(&mut self) -> Result<Vec<Id>, Fault> {
        let mark = self.marks.pop().ok_or_else(|| self.malformed("a mark on the stack", "none"))?;
        Ok(self.stack.split_off(mark))
    }

    fn u8(&mut self) -> Result<u8, Fault> {
        Ok(self.array::<1>()?[0])
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let range = self.take(N)?;
        Ok(std::array::from_fn(|n| self.bytes[range.start + n]))
    }

    fn take(&mut self, count: usize) -> Result<Range<usize>, Fault> {
        let left = self.bytes.len() - self.at;
        if count > left {
            return Err(self.malformed(&format!("{count} bytes"), left));
        }
        let range = self.at..self.at + count;
        self.at = range.end;
        Ok(range)
    }

    fn malformed(&self, expected: &str, found: impl ToString) -> Fault {
        Fault::malformed(format!("byte {} of {}", self.instruction, self.name), expected, found)
    }
}
