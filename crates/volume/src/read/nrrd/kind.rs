//! Types of numbers, by all their names.

use crate::VolumeError;
use crate::read::scalar::{Kind, Stored};
use crate::read::text_header::{Entries, shown};

/// How the numbers are stored.
pub(super) fn stored(fields: &Entries) -> Result<Stored, VolumeError> {
    let entry = fields.wanted("type")?;
    let name = entry.value.split_whitespace().collect::<Vec<_>>().join(" ");
    let kind = match name.to_ascii_lowercase().as_str() {
        "signed char" | "int8" | "int8_t" => Kind::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => Kind::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => {
            Kind::I16
        }
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Kind::U16,
        "int" | "signed int" | "int32" | "int32_t" => Kind::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => Kind::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => Kind::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => {
            Kind::U64
        }
        "float" => Kind::F32,
        "double" => Kind::F64,
        "block" => {
            return Err(entry
                .refused("the voxels are blocks of bytes, not numbers")
                .hint("write them as integers or floats, one number per voxel"));
        }
        _ => {
            return Err(entry
                .refused(format!(
                    "`{}` is a type unknown in NRRD",
                    shown(&entry.value)
                ))
                .hint("write them as integers or floats, one number per voxel"));
        }
    };
    let is_big_endian = match fields.get("endian") {
        None if kind.bytes() == 1 => false,
        None => {
            return Err(VolumeError::refused(format!(
                "the byte order of the {} numbers is not stated",
                kind.name()
            ))
            .at("endian")
            .hint("add a line to the header: `endian: little`, or `endian: big`"));
        }
        Some(entry) => match entry.value.to_ascii_lowercase().as_str() {
            "little" => false,
            "big" => true,
            _ => {
                return Err(entry
                    .refused(format!("`{}` is not a byte order", shown(&entry.value)))
                    .hint("little or big"));
            }
        },
    };
    Ok(Stored {
        kind,
        is_big_endian,
        bits: None,
    })
}
