//! Names of labels in an extension of the header: the table of Caret's XML, which TotalSegmentator writes, too.
//!
//! Of all other extensions nothing is read: those of DICOM and AFNI have names of patients.

use std::collections::BTreeMap;

use crate::read::bytes::ByteStream;
use crate::{Remark, VolumeError};

/// Longest extension that is looked at: a table of 65535 names has less.
const MOST_BYTES: u64 = 1 << 23;

/// Size and code before the content of an extension.
const HEAD: u64 = 8;

/// Labels with their names.
type Names = BTreeMap<u16, String>;

/// The names that extensions between the header and byte `end` have; none where there is no table.
pub(super) fn names(
    stream: &mut ByteStream,
    end: u64,
    is_big_endian: bool,
    remarks: &mut Vec<Remark>,
) -> Result<Names, VolumeError> {
    let mut flag = [0; 4];
    if stream.fill(&mut flag)? < flag.len() || flag[0] == 0 {
        return Ok(Names::new());
    }
    let mut head = [0; 8];
    while end.saturating_sub(stream.at()) >= HEAD && stream.fill(&mut head)? == head.len() {
        let size = [head[0], head[1], head[2], head[3]];
        let size = if is_big_endian {
            u32::from_be_bytes(size)
        } else {
            u32::from_le_bytes(size)
        };
        let Some(length) = u64::from(size).checked_sub(HEAD) else {
            break;
        };
        if length > end.saturating_sub(stream.at()) {
            break;
        }
        if length > MOST_BYTES {
            stream.skip_to(stream.at() + length)?;
            continue;
        }
        let mut content = vec![0; usize::try_from(length).unwrap_or(0)];
        let got = stream.fill(&mut content)?;
        let Some(table) = table(&String::from_utf8_lossy(&content[..got])) else {
            continue;
        };
        match table {
            Ok(names) => return Ok(names),
            Err(problem) => {
                let remark = format!("its table of label names is not used: {problem}");
                remarks.push(Remark::new(remark).at("header extension"));
            }
        }
    }
    Ok(Names::new())
}

/// The first table of a document; none where it has none.
fn table(text: &str) -> Option<Result<Names, String>> {
    let (_, rest) = text.split_once("<LabelTable")?;
    let mut rest = rest
        .split_once("</LabelTable>")
        .map_or(rest, |(table, _)| table);
    let mut names = Names::new();
    while let Some((_, after)) = rest.split_once("<Label") {
        let Some((attributes, after)) = after.split_once('>') else {
            break;
        };
        rest = after;
        if !attributes.starts_with(char::is_whitespace) || attributes.ends_with('/') {
            continue;
        }
        let Some((content, after)) = after.split_once("</Label>") else {
            return Some(Err("it is cut off".to_owned()));
        };
        rest = after;
        let Some(key) = key(attributes) else {
            return Some(Err("a label has no number".to_owned()));
        };
        let name = content_text(content);
        // Nothing, and what no label map of 16 bits has.
        let Some(label) = u16::try_from(key).ok().filter(|&label| label > 0) else {
            continue;
        };
        if name.is_empty() {
            continue;
        }
        if let Some(other) = names.insert(label, name.clone())
            && other != name
        {
            return Some(Err(format!(
                "label {label} is named `{other}` and `{name}`"
            )));
        }
    }
    Some(Ok(names))
}

/// The value of the attribute `Key`.
fn key(attributes: &str) -> Option<i64> {
    let mut rest = attributes;
    while let Some((name, after)) = rest.split_once('=') {
        let after = after.trim_start();
        let quote = after.chars().next().filter(|&it| it == '"' || it == '\'')?;
        let (value, after) = after[1..].split_once(quote)?;
        if name.trim() == "Key" {
            return value.trim().parse().ok();
        }
        rest = after;
    }
    None
}

/// The text of an element, without what terminals would take for a command.
fn content_text(content: &str) -> String {
    let content = content.trim();
    let quoted = content
        .strip_prefix("<![CDATA[")
        .and_then(|text| text.strip_suffix("]]>"));
    let text = quoted.map_or_else(|| unescaped(content), str::to_owned);
    let text: String = text.chars().filter(|letter| !letter.is_control()).collect();
    text.trim().to_owned()
}

fn unescaped(text: &str) -> String {
    text.replace("&lt;", "<")
        .replace("&gt;", ">")
        .replace("&quot;", "\"")
        .replace("&apos;", "'")
        .replace("&amp;", "&")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wrapped(labels: &str) -> String {
        format!(
            "<?xml version=\"1.0\"?><CaretExtension><VolumeInformation Index=\"0\"><LabelTable>{labels}\
             </LabelTable></VolumeInformation></CaretExtension>\0\0"
        )
    }

    #[test]
    fn a_table_is_read_as_others_write_it() {
        let text = wrapped(
            "<Label Key=\"0\" Red=\"0\"><![CDATA[???]]></Label>\n\
             <Label Red=\"0.1\" Key=\"1\" Alpha=\"1\"><![CDATA[spleen]]></Label>\n\
             <Label Key='7'>nodule &lt;8 mm &amp; cyst</Label><Label Key=\"8\"/>\
             <Label Key=\"70000\"><![CDATA[far]]></Label>",
        );
        let names = table(&text).unwrap().unwrap();
        let wanted = [
            (1, "spleen".to_owned()),
            (7, "nodule <8 mm & cyst".to_owned()),
        ];
        assert_eq!(names, wanted.into());
        assert_eq!(table("<AFNI_attributes>Label</AFNI_attributes>"), None);
    }

    #[test]
    fn what_cannot_be_relied_on_is_not_used() {
        for labels in [
            "<Label Key=\"1\">a</Label><Label Key=\"1\">b</Label>",
            "<Label Key=\"1\">a",
            "<Label Red=\"1\">a</Label>",
            "<Label Key=\"one\">a</Label>",
            "<Label Key=1>a</Label>",
        ] {
            assert!(table(&wrapped(labels)).unwrap().is_err(), "{labels}");
        }
    }
}
