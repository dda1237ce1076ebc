//! A store in a file: written entries survive damage at the file's end and other writers.

use std::{fs, io::Write, path::Path, thread};

use bottega_agents::{
    Key, Revision, StoreReply, StoreRequest, Ticket,
    entry_store::EntryStore,
    file_store::{FileStore, FileStoreError, VALUE_BYTES_MAX},
    store::{AddressedStore, MemoryStore},
};
use proptest::prelude::*;

type Store = FileStore<String, usize>;

fn open(path: &Path) -> Store {
    Store::open(path).unwrap()
}

fn handle(store: &mut impl EntryStore<String, usize>, request: StoreRequest<String>) -> Vec<StoreReply<String>> {
    let mut replies = Vec::new();
    store.handle(7, Ticket(1), request, &mut replies);
    replies.into_iter().map(|AddressedStore { reply, .. }| reply).collect()
}

fn put(key: &str, value: &str) -> StoreRequest<String> {
    StoreRequest::Put { key: key.into(), value: value.into() }
}

fn poll(store: &mut Store) -> Vec<StoreReply<String>> {
    let mut replies = Vec::new();
    store.poll(&mut replies);
    replies.into_iter().map(|AddressedStore { reply, .. }| reply).collect()
}

fn value(store: &Store, key: &str) -> Option<String> {
    store.get(&key.into()).map(|entry| entry.value.clone())
}

fn any_request() -> impl Strategy<Value = StoreRequest<String>> {
    let key = || prop::sample::select(vec!["a", "a/b", "c"]).prop_map(Key::from);
    let text = "[a-z]{1,3}";
    prop_oneof![
        (key(), text).prop_map(|(key, value)| StoreRequest::Put { key, value }),
        (key(), 0..6_u64, text).prop_map(|(key, revision, value)| StoreRequest::CompareAndSet {
            key,
            expected_revision: Revision(revision),
            value
        }),
        key().prop_map(|key| StoreRequest::Get { key }),
        key().prop_map(|prefix| StoreRequest::Watch { prefix }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// The store answers like a store in memory, also after it was opened again.
    #[test]
    fn it_behaves_as_a_store_in_memory(requests in prop::collection::vec(any_request(), 1..30), reopen in 0..30_usize) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state");
        let (mut file, mut memory) = (open(&path), MemoryStore::<String, usize>::default());
        for (index, request) in requests.into_iter().enumerate() {
            if index == reopen {
                file = open(&path);
                memory.forget(&7);
            }
            prop_assert_eq!(handle(&mut file, request.clone()), handle(&mut memory, request));
        }
    }

    /// A file cut anywhere keeps the writes before the cut, and accepts more.
    #[test]
    fn a_torn_end_costs_what_was_torn_and_no_more(cut in any::<prop::sample::Index>(), junk in prop::collection::vec(any::<u8>(), 0..40)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state");
        let mut ends = Vec::new();
        let mut store = open(&path);
        for number in 0..5 {
            handle(&mut store, put(&format!("k{number}"), "value"));
            ends.push(store.log_bytes());
        }
        drop(store);
        let bytes = fs::read(&path).unwrap();
        let length = cut.index(bytes.len() + 1);
        fs::write(&path, [&bytes[..length], &junk[..]].concat()).unwrap();
        let whole = ends.iter().filter(|end| **end <= length as u64).count();
        if length < 16 && length + junk.len() >= 16 {
            // A file that is not a store, or an unknown generation.
            return Ok(());
        }
        let mut store = open(&path);
        for number in 0..5 {
            prop_assert_eq!(value(&store, &format!("k{number}")).is_some(), number < whole);
        }
        handle(&mut store, put("more", "x"));
        prop_assert_eq!(value(&open(&path), "more"), Some("x".to_owned()));
    }
}

#[test]
fn two_who_have_it_open_see_each_other_and_one_of_two_wins() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state");
    let (mut one, mut two) = (open(&path), open(&path));
    handle(&mut two, StoreRequest::Watch { prefix: "a/".into() });
    handle(&mut one, put("a/1", "x"));
    handle(&mut one, put("b/1", "y"));
    assert!(matches!(&poll(&mut two)[..], [StoreReply::Changed(entry)] if entry.value == "x"));
    let cas = |value: &str| StoreRequest::CompareAndSet {
        key: "a/1".into(),
        expected_revision: Revision(1),
        value: value.into(),
    };
    assert!(matches!(&handle(&mut one, cas("p"))[..], [StoreReply::Written { .. }]));
    match &handle(&mut two, cas("q"))[..] {
        // First the other's write is reported, then the conflict.
        [StoreReply::Changed(_), StoreReply::Conflict { entry: Some(entry), .. }] => assert_eq!(entry.value, "p"),
        other => panic!("{other:?}"),
    }
    handle(&mut one, put("a/1", ""));
    assert!(matches!(&poll(&mut two)[..], [StoreReply::Changed(entry)] if entry.value.is_empty()));
    assert_eq!(value(&two, "a/1"), None);
}

#[test]
fn many_who_count_together_count_right() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state");
    thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                let mut store = open(&path);
                for _ in 0..25 {
                    loop {
                        let entry = store.get(&"count".into()).cloned();
                        let (count, expected_revision) = entry.map_or((0, Revision::ABSENT), |entry| {
                            (entry.value.parse::<u32>().unwrap(), entry.revision)
                        });
                        let value = (count + 1).to_string();
                        let cas = StoreRequest::CompareAndSet { key: "count".into(), expected_revision, value };
                        if matches!(handle(&mut store, cas).last(), Some(StoreReply::Written { .. })) {
                            break;
                        }
                    }
                }
            });
        }
    });
    assert_eq!(value(&open(&path), "count").as_deref(), Some("100"));
}

#[test]
fn a_long_log_is_rewritten_and_watchers_lose_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state");
    let (mut one, mut two) = (open(&path), open(&path));
    handle(&mut two, StoreRequest::Watch { prefix: "".into() });
    handle(&mut one, put("gone", "x"));
    poll(&mut two);
    handle(&mut one, put("gone", ""));
    let long = "v".repeat(1 << 16);
    let mut longest = 0;
    for number in 0..40 {
        handle(&mut one, put(&format!("k{}", number % 2), &format!("{number}{long}")));
        longest = longest.max(one.log_bytes());
    }
    assert!(longest < 40 * (1 << 15), "{longest} bytes for two values of 64 KiB");
    let replies = poll(&mut two);
    let last = |key: &str| {
        replies.iter().rev().find_map(|reply| match reply {
            StoreReply::Changed(entry) if entry.key == key.into() => Some(entry.value.clone()),
            _ => None,
        })
    };
    assert_eq!(last("gone").as_deref(), Some(""));
    assert!(last("k1").unwrap().starts_with("39v"));
    // Both continue in the new file, and so do revisions.
    let before = one.get(&"k1".into()).unwrap().revision;
    handle(&mut two, put("k1", "two"));
    assert!(two.get(&"k1".into()).unwrap().revision > before);
    poll(&mut one);
    assert_eq!(value(&one, "k1").as_deref(), Some("two"));
    assert_eq!(value(&open(&path), "k0"), value(&one, "k0"));
}

#[test]
fn what_is_too_large_is_not_taken_and_what_is_something_else_not_touched() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state");
    let mut store = open(&path);
    let large = "v".repeat(VALUE_BYTES_MAX + 1);
    assert_eq!(handle(&mut store, put("a", &large)), [StoreReply::Unavailable]);
    assert_eq!(handle(&mut store, put("", "x")), [StoreReply::Unavailable]);
    assert_eq!(value(&open(&path), "a"), None);
    let other = folder.path().join("other");
    fs::File::create(&other).unwrap().write_all(b"a letter to grandmother").unwrap();
    assert!(matches!(Store::open(&other), Err(FileStoreError::Magic)));
    assert_eq!(fs::read(&other).unwrap(), b"a letter to grandmother");
}
