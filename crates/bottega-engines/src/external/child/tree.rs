//! A process and all that it has started, as the system tells of them.

/// The variable that marks whatever a child has started, so that it is found even when it left the group.
pub(super) const MARK: &str = "BOTTEGA_ENGINE_CHILD";

/// What a child and its children take. All 0 where the system does not tell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Tree {
    pub(super) processes: usize,
    pub(super) resident_bytes: u64,
}

#[cfg(not(target_os = "linux"))]
mod system {
    use super::Tree;

    impl Tree {
        pub(in super::super) fn of(_root: u32) -> Tree {
            Tree::default()
        }
    }

    pub(in super::super) fn marked(_mark: &str) -> Vec<u32> {
        Vec::new()
    }

    pub(in super::super) fn kill(_process: u32) {}
}

#[cfg(target_os = "linux")]
mod system {
    use std::{collections::BTreeMap, fs};

    use super::{MARK, Tree};

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
        // The name of the program stands in brackets and may hold anything.
        let fields: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
        let number = |i: usize| fields.get(i).and_then(|field| field.parse::<u64>().ok());
        // proc(5): the parent is field 4, the resident pages 24; the first of `fields` is 3.
        Some(Stat { parent: number(1)? as u32, pages: number(21)? })
    }

    impl Tree {
        /// Of the process `root` and all below it.
        pub(in super::super) fn of(root: u32) -> Tree {
            let all: BTreeMap<u32, Stat> = processes().filter_map(|id| Some((id, stat(id)?))).collect();
            let mut tree = Tree::default();
            let mut next = vec![root];
            while let Some(id) = next.pop() {
                let Some(found) = all.get(&id) else { continue };
                tree.processes += 1;
                tree.resident_bytes += found.pages * rustix::param::page_size() as u64;
                if tree.processes <= all.len() {
                    next.extend(all.iter().filter(|(_, stat)| stat.parent == id).map(|(id, _)| *id));
                }
            }
            tree
        }
    }

    /// All processes that carry this mark.
    pub(in super::super) fn marked(mark: &str) -> Vec<u32> {
        let wanted = format!("{MARK}={mark}");
        let carries = |id: &u32| {
            let environment = fs::read(format!("/proc/{id}/environ")).unwrap_or_default();
            environment.split(|byte| *byte == 0).any(|entry| entry == wanted.as_bytes())
        };
        processes().filter(carries).collect()
    }

    pub(in super::super) fn kill(process: u32) {
        if let Some(process) = i32::try_from(process).ok().and_then(rustix::process::Pid::from_raw) {
            let _ = rustix::process::kill_process(process, rustix::process::Signal::KILL);
        }
    }
}

pub(super) use system::{kill, marked};
