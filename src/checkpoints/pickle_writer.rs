//! Checkpoints that PyTorch reads, also with `weights_only=True`, and this project's own reader in `import`: a zip archive
//! of a pickle and of each tensor's numbers. Nothing of PyTorch is needed to write them.

use std::borrow::Cow;
use std::io::{self, ErrorKind, Seek, Write};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

/// Bytes that numbers are aligned to in the file.
const ALIGNMENT: u16 = 64;
/// The archive's folder; any name is allowed.
const FOLDER: &str = "archive";

/// A value of a checkpoint.
///
/// ```
/// use std::io::Cursor;
/// use strivec_checkpoints::{Value, write_checkpoint};
///
/// let bias = Value::tensor([3], vec![0.0_f32, 0.5, 1.0]);
/// let state = Value::OrderedDict(vec![("layer.bias".into(), bias)]);
/// let root = Value::Dict(vec![("steps".into(), Value::Int(500)), ("state_dict".into(), state)]);
/// let bytes = write_checkpoint(Cursor::new(Vec::new()), &root)?.into_inner();
/// assert!(bytes.starts_with(b"PK"));
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Value<'a> {
    /// `None`.
    None,
    /// A `bool`.
    Bool(bool),
    /// An `int`.
    Int(i64),
    /// A `float`.
    Float(f64),
    /// A `str`.
    Text(Cow<'a, str>),
    /// A `list`.
    List(Vec<Value<'a>>),
    /// A `tuple`.
    Tuple(Vec<Value<'a>>),
    /// A `dict` with texts as keys.
    Dict(Vec<(Cow<'a, str>, Value<'a>)>),
    /// A `collections.OrderedDict` with texts as keys: a `state_dict`.
    OrderedDict(Vec<(Cow<'a, str>, Value<'a>)>),
    /// A tensor on the CPU.
    Tensor(Tensor<'a>),
    /// A NumPy array, inside the pickle. `weights_only=True` refuses NumPy arrays, unless their types are allowed.
    Array(Tensor<'a>),
}

/// A tensor: its lengths of axes, and its numbers, the last axis fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor<'a> {
    /// Lengths of its axes; none for a single number.
    pub shape: Vec<usize>,
    /// As many as the product of the lengths.
    pub numbers: Numbers<'a>,
}

/// The numbers of a tensor.
#[derive(Clone, Debug, PartialEq)]
pub enum Numbers<'a> {
    /// `torch.float32`.
    F32(Cow<'a, [f32]>),
    /// `torch.int64`.
    I64(Cow<'a, [i64]>),
    /// `torch.uint8`.
    U8(Cow<'a, [u8]>),
    /// `torch.bool`.
    Bool(Cow<'a, [bool]>),
}

macro_rules! numbers {
    ($($type:ty: $variant:ident;)*) => {$(
        impl From<Vec<$type>> for Numbers<'_> {
            fn from(numbers: Vec<$type>) -> Self {
                Self::$variant(numbers.into())
            }
        }

        impl<'a> From<&'a [$type]> for Numbers<'a> {
            fn from(numbers: &'a [$type]) -> Self {
                Self::$variant(numbers.into())
            }
        }
    )*};
}

numbers! {
    f32: F32;
    i64: I64;
    u8: U8;
    bool: Bool;
}

impl<'a> Value<'a> {
    /// A tensor of this shape.
    pub fn tensor(shape: impl Into<Vec<usize>>, numbers: impl Into<Numbers<'a>>) -> Self {
        Self::Tensor(Tensor { shape: shape.into(), numbers: numbers.into() })
    }

    /// A NumPy array of this shape.
    pub fn array(shape: impl Into<Vec<usize>>, numbers: impl Into<Numbers<'a>>) -> Self {
        Self::Array(Tensor { shape: shape.into(), numbers: numbers.into() })
    }

    /// A text.
    pub fn text(text: impl Into<Cow<'a, str>>) -> Self {
        Self::Text(text.into())
    }
}

impl Numbers<'_> {
    fn len(&self) -> usize {
        match self {
            Self::F32(numbers) => numbers.len(),
            Self::I64(numbers) => numbers.len(),
            Self::U8(numbers) => numbers.len(),
            Self::Bool(numbers) => numbers.len(),
        }
    }

    /// PyTorch's class of their storage, and the bytes of a number.
    fn storage(&self) -> (&'static str, usize) {
        match self {
            Self::F32(_) => ("FloatStorage", 4),
            Self::I64(_) => ("LongStorage", 8),
            Self::U8(_) => ("ByteStorage", 1),
            Self::Bool(_) => ("BoolStorage", 1),
        }
    }

    /// NumPy's name of their type, and the order of its bytes.
    fn dtype(&self) -> (&'static str, &'static str) {
        match self {
            Self::F32(_) => ("f4", "<"),
            Self::I64(_) => ("i8", "<"),
            Self::U8(_) => ("u1", "|"),
            Self::Bool(_) => ("b1", "|"),
        }
    }

    fn write(&self, out: &mut impl Write) -> io::Result<()> {
        /// Numbers that are converted at once.
        const AT_ONCE: usize = 1 << 14;
        fn put<T: Copy, const N: usize>(
            numbers: &[T],
            bytes: fn(T) -> [u8; N],
            out: &mut impl Write,
        ) -> io::Result<()> {
            let write = |part: &[T]| out.write_all(&part.iter().flat_map(|&n| bytes(n)).collect::<Vec<u8>>());
            numbers.chunks(AT_ONCE).try_for_each(write)
        }
        match self {
            Self::F32(numbers) => put(numbers, f32::to_le_bytes, out),
            Self::I64(numbers) => put(numbers, i64::to_le_bytes, out),
            Self::U8(numbers) => out.write_all(numbers),
            Self::Bool(numbers) => put(numbers, |bit| [u8::from(bit)], out),
        }
    }
}

/// Writes `root` as `torch.save` writes it. Equal values give equal bytes: no entry has a date.
///
/// # Errors
///
/// If `out` fails, and [`ErrorKind::InvalidInput`] if a tensor or array has more or fewer numbers than its shape, or a text
/// has 4 GiB.
pub fn write_checkpoint<W: Write + Seek>(out: W, root: &Value<'_>) -> io::Result<W> {
    let pickle = PickleWriter::of(root)?;
    let mut zip = ZipWriter::new(out);
    let start = |zip: &mut ZipWriter<W>, name: &str, bytes: usize| {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .last_modified_time(DateTime::default())
            .large_file(u32::try_from(bytes).is_err())
            .with_alignment(ALIGNMENT);
        zip.start_file(format!("{FOLDER}/{name}"), options)
    };
    for (name, bytes) in [("data.pkl", pickle.bytes.as_slice()), ("byteorder", b"little")] {
        start(&mut zip, name, bytes.len())?;
        zip.write_all(bytes)?;
    }
    for (key, numbers) in pickle.tensors.iter().enumerate() {
        start(&mut zip, &format!("data/{key}"), numbers.len() * numbers.storage().1)?;
        numbers.write(&mut zip)?;
    }
    start(&mut zip, "version", 2)?;
    zip.write_all(b"3\n")?;
    Ok(zip.finish()?)
}

/// Writes `root` as `pickle.dump` writes it, with protocol 2.
///
/// # Errors
///
/// If `out` fails, and [`ErrorKind::InvalidInput`] as [`write_checkpoint`], and if there is a tensor, whose numbers a pickle does
/// not hold.
pub fn write_pickle(mut out: impl Write, root: &Value<'_>) -> io::Result<()> {
    let pickle = PickleWriter::of(root)?;
    if !pickle.tensors.is_empty() {
        return Err(io::Error::new(ErrorKind::InvalidInput, "a pickle alone cannot hold a tensor"));
    }
    out.write_all(&pickle.bytes)
}

/// Fails unless `found` is the product of `shape`.
fn check_count(shape: &[usize], found: usize) -> io::Result<()> {
    if shape.iter().product::<usize>() == found {
        return Ok(());
    }
    let message = format!("a tensor of shape {shape:?} cannot hold {found} numbers");
    Err(io::Error::new(ErrorKind::InvalidInput, message))
}

/// A pickle of protocol 2, as PyTorch's.
struct PickleWriter<'a> {
    bytes: Vec<u8>,
    /// The numbers of each tensor; their places are the keys of the storages.
    tensors: Vec<&'a Numbers<'a>>,
}

impl<'a> PickleWriter<'a> {
    fn of(root: &'a Value<'a>) -> io::Result<Self> {
        let mut pickle = Self { bytes: b"\x80\x02".to_vec(), tensors: Vec::new() };
        pickle.put(root)?;
        pickle.bytes.push(b'.');
        Ok(pickle)
    }

    fn put(&mut self, value: &'a Value<'a>) -> io::Result<()> {
        match value {
            Value::None => self.bytes.push(b'N'),
            Value::Bool(value) => self.put_bool(*value),
            Value::Int(value) => self.put_int(*value),
            Value::Float(value) => {
                self.bytes.push(b'G');
                self.bytes.extend(value.to_be_bytes());
            }
            Value::Text(text) => self.put_text(text)?,
            Value::List(items) => {
                self.bytes.extend(b"](");
                items.iter().try_for_each(|item| self.put(item))?;
                self.bytes.push(b'e');
            }
            Value::Tuple(items) => {
                self.bytes.push(b'(');
                items.iter().try_for_each(|item| self.put(item))?;
                self.bytes.push(b't');
            }
            Value::Dict(pairs) => {
                self.bytes.push(b'}');
                self.put_items(pairs)?;
            }
            Value::OrderedDict(pairs) => {
                self.put_ordered_dict();
                self.put_items(pairs)?;
            }
            Value::Tensor(tensor) => self.put_tensor(tensor)?,
            Value::Array(array) => self.put_array(array)?,
        }
        Ok(())
    }

    fn put_bool(&mut self, value: bool) {
        self.bytes.push(if value { 0x88 } else { 0x89 });
    }

    fn put_int(&mut self, value: i64) {
        if let Ok(small) = i32::try_from(value) {
            self.bytes.push(b'J');
            self.bytes.extend(small.to_le_bytes());
        } else {
            self.bytes.extend([0x8a, 8]);
            self.bytes.extend(value.to_le_bytes());
        }
    }

    fn put_text(&mut self, text: &str) -> io::Result<()> {
        let too_long = |_| io::Error::new(ErrorKind::InvalidInput, "a text of 4 GiB or more cannot be pickled");
        let length = u32::try_from(text.len()).map_err(too_long)?;
        self.bytes.push(b'X');
        self.bytes.extend(length.to_le_bytes());
        self.bytes.extend(text.as_bytes());
        Ok(())
    }

    /// A class or function.
    fn put_global(&mut self, module: &str, name: &str) {
        self.bytes.extend(format!("c{module}\n{name}\n").as_bytes());
    }

    /// An empty ordered dictionary.
    fn put_ordered_dict(&mut self) {
        self.put_global("collections", "OrderedDict");
        self.bytes.extend(b")R");
    }

    /// The pairs of the dictionary on top of the stack.
    fn put_items(&mut self, pairs: &'a [(Cow<'a, str>, Value<'a>)]) -> io::Result<()> {
        self.bytes.push(b'(');
        for (key, value) in pairs {
            self.put_text(key)?;
            self.put(value)?;
        }
        self.bytes.push(b'u');
        Ok(())
    }

    fn put_lengths(&mut self, lengths: impl IntoIterator<Item = usize>) {
        self.bytes.push(b'(');
        lengths.into_iter().for_each(|length| self.put_int(length as i64));
        self.bytes.push(b't');
    }

    fn put_tensor(&mut self, tensor: &'a Tensor<'a>) -> io::Result<()> {
        let Tensor { shape, numbers } = tensor;
        check_count(shape, numbers.len())?;
        self.put_global("torch._utils", "_rebuild_tensor_v2");
        self.bytes.extend(b"((");
        self.put_text("storage")?;
        self.put_global("torch", numbers.storage().0);
        self.put_text(&self.tensors.len().to_string())?;
        self.put_text("cpu")?;
        self.put_int(numbers.len() as i64);
        // The end of the storage's tuple; its value is that of the persistent id; the offset of the first number.
        self.bytes.extend(b"tQ");
        self.put_int(0);
        self.put_lengths(shape.iter().copied());
        self.put_lengths((0..shape.len()).map(|axis| shape[axis + 1..].iter().product()));
        // It requires no gradient and has no hooks.
        self.put_bool(false);
        self.put_ordered_dict();
        self.bytes.extend(b"tR");
        self.tensors.push(numbers);
        Ok(())
    }

    fn put_array(&mut self, array: &Tensor<'_>) -> io::Result<()> {
        let Tensor { shape, numbers } = array;
        check_count(shape, numbers.len())?;
        let (name, order) = numbers.dtype();
        self.put_global("numpy.core.multiarray", "_reconstruct");
        self.bytes.push(b'(');
        self.put_global("numpy", "ndarray");
        self.put_lengths([0]);
        self.put_bytes(b"b")?;
        self.bytes.extend(b"tR(");
        // The state: a version, the shape, the type, the order of axes, the numbers.
        self.put_int(1);
        self.put_lengths(shape.iter().copied());
        self.put_global("numpy", "dtype");
        self.bytes.push(b'(');
        self.put_text(name)?;
        self.put_bool(false);
        self.put_bool(true);
        self.bytes.extend(b"tR(");
        self.put_int(3);
        self.put_text(order)?;
        self.bytes.extend(b"NNN");
        [-1, -1, 0].into_iter().for_each(|value| self.put_int(value));
        self.bytes.extend(b"tb");
        self.put_bool(false);
        let mut bytes = Vec::new();
        numbers.write(&mut bytes)?;
        self.put_bytes(&bytes)?;
        self.bytes.extend(b"tb");
        Ok(())
    }

    /// Bytes as a text of code points below 256, since protocol 2 has no bytes.
    fn put_bytes(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.put_global("_codecs", "encode");
        self.bytes.push(b'(');
        self.put_text(&bytes.iter().map(|&byte| char::from(byte)).collect::<String>())?;
        self.put_text("latin1")?;
        self.bytes.extend(b"tR");
        Ok(())
    }
}
