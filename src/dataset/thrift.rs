//! Structures of Thrift's compact protocol, in which Parquet describes a file and its pages. They are walked before the
//! parser sees them.
//!
//! The parser skips what it does not know, and takes a truth value in a list for no bytes at all: a kilobyte that claims
//! lists of two thousand million of them keeps it busy for hours. In nothing that is walked here has Parquet such a list,
//! and all else takes a byte or more, so that a walk ends with the bytes.

use std::io::{self, ErrorKind, Read};

/// Structures within structures: the parser goes no deeper.
const MAX_DEPTH: u32 = 64;

/// Codes of types. 1 and 2 are truth values, whose type is their value.
const I16: u8 = 4;
const I32: u8 = 5;
const I64: u8 = 6;
const STRUCTURE: u8 = 12;

/// Field of 32 bits: its number, and where it is one of a structure within, that of the structure before it.
pub(super) type Field = (Option<i64>, i64);

/// Walks a structure, to its end. Returns the fields of 32 bits, with their values, of it and of the structures that are
/// its own fields.
pub(super) fn walk(source: impl Read) -> io::Result<Vec<(Field, i64)>> {
    let mut walk = Walk { source };
    let mut found = Vec::new();
    let mut number = 0;
    while let Some(kind) = walk.field(&mut number)? {
        match kind {
            I32 => found.push(((None, number), walk.integer()?)),
            STRUCTURE => {
                let mut inner = 0;
                while let Some(kind) = walk.field(&mut inner)? {
                    match kind {
                        I32 => found.push(((Some(number), inner), walk.integer()?)),
                        kind => walk.value(kind, MAX_DEPTH - 2)?,
                    }
                }
            }
            kind => walk.value(kind, MAX_DEPTH - 1)?,
        }
    }
    Ok(found)
}

struct Walk<R> {
    source: R,
}

impl<R: Read> Walk<R> {
    /// Walks the head of a field. Returns its type; `None` at the end of the structure.
    fn field(&mut self, number: &mut i64) -> io::Result<Option<u8>> {
        let head = self.byte()?;
        match (head >> 4, head & 15) {
            (_, 0) => return Ok(None),
            (0, _) => *number = self.integer()?,
            (step, _) => *number = number.wrapping_add(step.into()),
        }
        Ok(Some(head & 15))
    }

    /// Walks a value of a field.
    fn value(&mut self, kind: u8, depth: u32) -> io::Result<()> {
        if depth == 0 {
            return Err(wrong("structures within structures without end"));
        }
        match kind {
            1 | 2 => Ok(()),
            3 => self.skip(1),
            I16 | I32 | I64 => self.integer().map(|_| ()),
            7 => self.skip(8),
            8 => {
                let length = self.varint()?;
                self.skip(length)
            }
            9 | 10 => {
                let head = self.byte()?;
                let length = if head >> 4 == 15 { self.varint()? } else { u64::from(head >> 4) };
                (0..length).try_for_each(|_| self.element(head & 15, depth - 1))
            }
            11 => match self.varint()? {
                0 => Ok(()),
                length => {
                    let kinds = self.byte()?;
                    (0..length).try_for_each(|_| {
                        self.element(kinds >> 4, depth - 1)?;
                        self.element(kinds & 15, depth - 1)
                    })
                }
            },
            STRUCTURE => {
                let mut number = 0;
                while let Some(kind) = self.field(&mut number)? {
                    self.value(kind, depth - 1)?;
                }
                Ok(())
            }
            13 => self.skip(16),
            _ => Err(wrong("a type that Thrift does not have")),
        }
    }

    /// Walks a value of a list or a map.
    fn element(&mut self, kind: u8, depth: u32) -> io::Result<()> {
        match kind {
            1 | 2 => Err(wrong("a list of truth values")),
            kind => self.value(kind, depth),
        }
    }

    fn byte(&mut self) -> io::Result<u8> {
        let mut byte = [0];
        self.source.read_exact(&mut byte)?;
        Ok(byte[0])
    }

    fn skip(&mut self, length: u64) -> io::Result<()> {
        match io::copy(&mut self.source.by_ref().take(length), &mut io::sink())? {
            there if there == length => Ok(()),
            _ => Err(ErrorKind::UnexpectedEof.into()),
        }
    }

    /// An unsigned number, 7 bits a byte.
    fn varint(&mut self) -> io::Result<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 127) << shift;
            if byte < 128 {
                return Ok(value);
            }
        }
        Err(wrong("a number of more than 64 bits"))
    }

    /// A signed number, whose sign is its last bit.
    fn integer(&mut self) -> io::Result<i64> {
        let value = self.varint()?;
        Ok((value >> 1).cast_signed() ^ -(value & 1).cast_signed())
    }
}

fn wrong(what: &str) -> io::Error {
    io::Error::new(ErrorKind::InvalidData, format!("it describes {what}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(bytes: &[u8]) -> String {
        walk(bytes).unwrap_err().to_string()
    }

    #[test]
    fn fields_are_numbered_by_steps_or_in_full() {
        // 1: 32 bits, -3; 2: true; 17: -1; 18: 300; 40, in full: 64 bits; 41: text; 42: list of two structures;
        // 43: structure of 1: true; 2: 7.
        let bytes = [
            0x15, 5, 0x11, 0xf5, 1, 0x15, 0xd8, 4, 0x06, 80, 1, 0x18, 2, b'a', b'b', 0x19, 0x2c, 0x15, 2, 0,
            0, 0x1c, 0x11, 0x15, 14, 0, 0,
        ];
        let own = |number, value| ((None, number), value);
        assert_eq!(walk(&bytes[..]).unwrap(), [own(1, -3), own(17, -1), own(18, 300), ((Some(43), 2), 7)]);
        assert_eq!(walk(&bytes[..3]).unwrap_err().kind(), ErrorKind::UnexpectedEof);
    }

    #[test]
    fn what_takes_no_bytes_is_refused() {
        let many = [0xff, 0xff, 0xff, 0xff, 7];
        assert_eq!(error(&[&[0x19, 0xf1][..], &many].concat()), "it describes a list of truth values");
        assert_eq!(error(&[&[0x1b][..], &many, &[0x11]].concat()), "it describes a list of truth values");
        for cut_short in
            [[&[0x19, 0xf5][..], &many, &[2; 9]], [&[0x18], &many, b"short"], [&[0x1b], &many, &[0x55]]]
        {
            assert_eq!(walk(&cut_short.concat()[..]).unwrap_err().kind(), ErrorKind::UnexpectedEof);
        }
    }

    #[test]
    fn nesting_ends() {
        assert_eq!(error(&[0x1c; 100]), "it describes structures within structures without end");
        assert_eq!(error(&[0x19].repeat(100)), "it describes structures within structures without end");
        assert_eq!(error(&[0x1e]), "it describes a type that Thrift does not have");
        assert_eq!(
            error(&[[0x16].as_slice(), &[0xff; 10]].concat()),
            "it describes a number of more than 64 bits"
        );
    }
}
