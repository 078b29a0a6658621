//! The stack machine that runs a pickle, without the instructions that execute code.
//!
//! `instructions` holds the instructions, `call` the values that calls of known functions produce.

mod call;
mod instructions;

use std::collections::HashMap;
use std::ops::Range;

use super::value::{Id, Value};
use strivec_import::Fault;

/// Instructions that one pickle may take.
const MAX_STEPS: u64 = 1 << 22;
/// Values that one pickle may create.
const MAX_VALUES: u64 = 1 << 20;
/// Bytes of the name of a function or module, and items of an argument list.
const MAX_NAME: usize = 256;
/// The newest protocol of pickles.
const NEWEST_PROTOCOL: u8 = 5;

struct Machine<'a> {
    /// The name of the pickle in errors.
    name: &'a str,
    bytes: &'a [u8],
    /// Offset of the next byte.
    at: usize,
    /// Offset of the current instruction.
    instruction: usize,
    values: Vec<Value>,
    stack: Vec<Id>,
    /// Heights of the stack at its marks.
    marks: Vec<usize>,
    memo: HashMap<u32, Id>,
}

/// Runs the pickle `bytes`. Returns its values and the one that remains on the stack.
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
        return Err(machine.malformed("the end of the pickle", format!("{} more bytes", bytes.len() - machine.at)));
    }
    Ok((machine.values, root))
}

impl Machine<'_> {
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

    fn malformed(&self, expected: &str, found: impl std::fmt::Display) -> Fault {
        Fault::malformed(format!("byte {} of {}", self.instruction, self.name), expected, found)
    }
}
