//! What is sound of a table that is damaged.

use std::ops::Range;
use std::path::Path;

use super::columns::Columns;
use super::manifest::Manifest;
use super::parquet_read::ParquetResults;
use super::parquet_write::{GROUP_CASES, Layout};

/// Gives the blocks that a damaged table still has, in their order.
///
/// A row group is taken for sound only if its cases, written again, make the same bytes by their CRC32: so
/// it does not matter which part of the footer said how to read them.
pub(crate) fn sound_blocks<E>(
    table: &Path,
    manifest: &Manifest,
    mut take: impl FnMut(u64, &Columns) -> Result<(), E>,
) -> Result<(), E> {
    let Ok(results) = ParquetResults::open_damaged(table, manifest) else {
        return Ok(());
    };
    let layout = Layout::new(manifest);
    let sound = |index: u64| -> Option<Columns> {
        let index = usize::try_from(index)
            .ok()
            .filter(|index| *index < results.groups())?;
        let (first, cases) = results.group(index).ok()?;
        (layout.crc(first, &cases)? == results.check(index)).then_some(cases)
    };
    // Those of the current block; the next one begins in the last of them.
    let mut groups: Vec<(u64, Option<Columns>)> = Vec::new();
    for block in 0..manifest.blocks() {
        let cases = manifest.block(block);
        let needed = cases.start / GROUP_CASES..=(cases.end - 1) / GROUP_CASES;
        groups.retain(|(index, _)| needed.contains(index));
        for index in needed {
            if groups.iter().all(|(known, _)| *known != index) {
                groups.push((index, sound(index)));
            }
        }
        if let Some(columns) = part(&groups, cases, manifest) {
            take(block, &columns)?;
        }
    }
    Ok(())
}

/// Cases of a block from its row groups, if all of them are sound.
fn part(
    groups: &[(u64, Option<Columns>)],
    cases: Range<u64>,
    manifest: &Manifest,
) -> Option<Columns> {
    let mut columns = Columns::new(&manifest.factors, manifest.columns.len());
    for (index, group) in groups {
        let group = group.as_ref()?;
        let first = index * GROUP_CASES;
        let from = cases.start.max(first) - first;
        let to = cases.end.min(first + group.cases as u64) - first;
        columns.extend(
            group,
            usize::try_from(from).ok()?..usize::try_from(to).ok()?,
        );
    }
    (columns.cases as u64 == cases.end - cases.start).then_some(columns)
}
