//! Boards as they were found when they were connected, and whether waves are worth painting for them.

/// Bytes a second that a cable must let through for each processor that only shades: its three to four million rays of 32 bytes, and as much
/// again, for they come in bursts. At three quarters of it a picture was as fast as in blocks.
const BYTES_OF_PROCESSOR: f64 = 200e6;

/// Boards must be worth so many of the processors that paint: waves take these 1.3 times as long as blocks, and 0.9 times where others
/// follow all of their rays, as was measured.
const SHARE_MIN: f64 = 0.75;

/// A board that is connected.
#[derive(Clone, Debug, PartialEq)]
pub struct ConnectedBoard {
    /// Its address.
    pub name: String,
    /// Threads that follow rays there.
    pub threads: u64,
    /// Bytes a second that pass on its cable each way, as measured.
    pub bandwidth: f64,
}

impl ConnectedBoard {
    /// Processors whose rays it can follow.
    fn worth(&self) -> f64 {
        (self.threads as f64).min(self.bandwidth / BYTES_OF_PROCESSOR)
    }
}

/// Whether a picture is done sooner in waves, whose rays boards follow, than in blocks without them.
///
/// - `processors`: those that paint.
pub(crate) fn are_worth_waves(boards: &[ConnectedBoard], processors: usize) -> bool {
    let worth: f64 = boards.iter().map(ConnectedBoard::worth).sum();
    !boards.is_empty() && worth >= SHARE_MIN * processors as f64
}

/// Why boards are left alone, for the user.
///
/// - `gpus`: names of those that paint.
pub(crate) fn left_alone(boards: &[ConnectedBoard], processors: usize, gpus: &[String]) -> String {
    let one = |board: &ConnectedBoard| {
        let threads = counted(board.threads, "thread");
        format!("{} ({threads}, {:.1} MB/s)", board.name, board.bandwidth / 1e6)
    };
    let names: Vec<String> = boards.iter().map(one).collect();
    let verb = if boards.len() == 1 { "is" } else { "are" };
    let alone = format!("{} {verb} left alone", names.join(", "));
    if !gpus.is_empty() {
        return format!("{alone}: {} paints whole paths faster; --wavefront uses boards all the same", gpus.join(", "));
    }
    let needed = SHARE_MIN * processors as f64;
    let painting = counted(processors as u64, "processor");
    format!(
        "{alone}: beside {painting} boards save time from {} and {:.0} MB/s on; --wavefront uses them all the same",
        counted(needed.ceil() as u64, "thread"),
        needed * BYTES_OF_PROCESSOR / 1e6
    )
}

fn counted(count: u64, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn board(threads: u64, megabytes: f64) -> ConnectedBoard {
        ConnectedBoard { name: "tcp://studio:7070".to_owned(), threads, bandwidth: megabytes * 1e6 }
    }

    #[test]
    fn boards_are_worth_what_their_threads_and_their_cables_let_through() {
        assert!(are_worth_waves(&[board(1, 1000.0)], 1));
        assert!(!are_worth_waves(&[board(64, 20.0)], 1), "the cable is too slow");
        assert!(!are_worth_waves(&[board(4, 1000.0)], 16), "too few threads");
        assert!(are_worth_waves(&[board(4, 1000.0), board(16, 2000.0)], 16));
        assert!(!are_worth_waves(&[], 1) && !are_worth_waves(&[], 0), "there is none");
    }

    #[test]
    fn the_user_is_told_why_a_board_is_left_alone() {
        let told = left_alone(&[board(1, 5.0)], 4, &[]);
        assert!(told.starts_with("tcp://studio:7070 (1 thread, 5.0 MB/s) is left alone"), "{told}");
        assert!(told.contains("3 threads and 600 MB/s"), "{told}");
    }
}
