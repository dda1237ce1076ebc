//! A test for the absences that ARCHITECTURE.md requires: no sockets, threads, clocks and files in protocol logic.

#[cfg(test)]
mod tests {
    use std::{
        fs,
        path::{Path, PathBuf},
    };

    use crate::bars::root;

    /// Folders of protocol logic, and the drivers below them, which perform I/O.
    const LOGIC: &[(&str, &[&str])] = &[
        ("crates/bottega-agents/src", &["driver", "file_store"]),
        ("crates/bottega-farm/src", &["driver", "driver.rs", "journal.rs"]),
        ("crates/bottega-fuzzy/src", &[]),
        ("crates/bottega-hra/src/policy", &[]),
    ];

    /// Functions and types that access a clock, a thread, a socket or a file.
    const IO: &[&str] = &[
        "Instant::now",
        "SystemTime::now",
        "thread::",
        "std::net",
        "std::fs",
        "std::process",
        "tokio::",
        "async_nats::",
        "TcpStream",
        "UdpSocket",
        "File::",
    ];

    #[test]
    fn protocol_logic_has_no_sockets_threads_clocks_or_files() {
        for (folder, drivers) in LOGIC {
            let drivers: Vec<PathBuf> = drivers.iter().map(|driver| root().join(folder).join(driver)).collect();
            let files = sources(&root().join(folder), &drivers);
            assert!(!files.is_empty(), "{folder} has no sources");
            for file in files {
                let text = fs::read_to_string(&file).expect("a source");
                // Tests stand at the end of a file.
                let logic = text.split("#[cfg(test)]").next().unwrap_or_default();
                for (number, line) in logic.lines().enumerate().filter(|(_, line)| !line.trim_start().starts_with("//"))
                {
                    let found = IO.iter().find(|io| line.contains(**io));
                    assert!(found.is_none(), "{}:{}: {line}", file.display(), number + 1);
                }
            }
        }
    }

    /// Crates and modules that may hold `unsafe` code; ARCHITECTURE.md says why.
    const UNSAFE: &[&str] = &[
        "bottega-kernels/",
        "bottega-platform/",
        "bottega-bench/src/rays/embree.rs",
        "bottega-denoise/src/library.rs",
        "bottega-gpu/src/memory.rs",
        "bottega-gpu/src/pipeline_cache.rs",
        "bottega-gpu/src/traversal.rs",
        "bottega-python/src/arrays.rs",
    ];

    #[test]
    fn unsafe_code_is_allowed_in_the_modules_that_the_architecture_names() {
        let crates = root().join("crates");
        let allows = |text: &str| text.contains("allow(unsafe_code") || text.contains("expect(unsafe_code");
        let files = sources(&crates, &[]).into_iter();
        let found = files.filter(|file| allows(&fs::read_to_string(file).expect("a source")));
        let found: Vec<String> = found
            .filter_map(|file| Some(file.strip_prefix(&crates).ok()?.to_string_lossy().replace('\\', "/")))
            .collect();
        for file in &found {
            assert!(UNSAFE.iter().any(|place| file.starts_with(place)), "{file} may not hold unsafe code");
        }
        for place in UNSAFE {
            assert!(found.iter().any(|file| file.starts_with(place)), "{place} holds no unsafe code any more");
        }
        let page = fs::read_to_string(root().join("ARCHITECTURE.md")).expect("the page");
        for place in UNSAFE {
            assert!(
                page.contains(&format!("`{}`", place.trim_end_matches('/'))),
                "ARCHITECTURE.md does not name {place}"
            );
        }
    }

    fn sources(folder: &Path, left_out: &[PathBuf]) -> Vec<PathBuf> {
        let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
        let mut found = Vec::new();
        for path in entries.filter(|path| !left_out.contains(path)) {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if path.is_dir() && name != "tests" {
                found.extend(sources(&path, left_out));
            } else if name.ends_with(".rs") && name != "tests.rs" {
                found.push(path);
            }
        }
        found
    }
}
