//! Processes listed by `/proc`.

use std::{collections::BTreeMap, fs};

use super::{
    signals::signal,
    tree_usage::{MARK, TreeUsage},
};

struct Stat {
    parent: u32,
    pages: u64,
}

fn processes() -> impl Iterator<Item = u32> {
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok())
}

fn stat(process: u32) -> Option<Stat> {
    let text = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // The program's name is in parentheses and may contain anything.
    let fields: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
    let number = |i: usize| fields.get(i).and_then(|field| field.parse::<u64>().ok());
    // proc(5): the parent is field 4, the resident pages 24; the first of `fields` is 3.
    Some(Stat { parent: number(1)? as u32, pages: number(21)? })
}

/// Returns the number of processes and the resident memory of the process with id `root` and its descendants. Zero: it does not
/// exist, or its `/proc` entry cannot be read.
pub fn usage(root: u32) -> TreeUsage {
    let all: BTreeMap<u32, Stat> = processes().filter_map(|id| Some((id, stat(id)?))).collect();
    let mut tree = TreeUsage::default();
    let mut next = vec![root];
    while let Some(id) = next.pop() {
        let Some(found) = all.get(&id) else { continue };
        tree.processes += 1;
        tree.resident_bytes += found.pages * rustix::param::page_size() as u64;
        // Limit the count, because a list made while processes change may contain cycles.
        if tree.processes <= all.len() {
            next.extend(all.iter().filter(|(_, stat)| stat.parent == id).map(|(id, _)| *id));
        }
    }
    tree
}

/// Returns the ids of all processes with this mark whose environments this user may read.
pub fn marked(mark: &str) -> Vec<u32> {
    let wanted = format!("{MARK}={mark}");
    let carries = |id: &u32| {
        let environment = fs::read(format!("/proc/{id}/environ")).unwrap_or_default();
        environment.split(|byte| *byte == 0).any(|entry| entry == wanted.as_bytes())
    };
    processes().filter(carries).collect()
}

/// Kills the process with this id. Returns `true` if it existed and this was allowed.
pub fn kill(process: u32) -> bool {
    signal(process, rustix::process::Signal::KILL)
}
