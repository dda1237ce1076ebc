//! The speed of connected boards, and the choice between waves and blocks.

/// Bandwidth in bytes per second needed per processor that only shades: 3 to 4 million rays of 32 bytes, times 2 because they
/// come in bursts. Measured: with three quarters of it a picture took as long as in blocks.
const BYTES_OF_PROCESSOR: f64 = 200e6;

/// Smallest worth of all boards, as a share of the rendering processors, for which waves pay off. Measured: waves take 1.3
/// times as long as blocks without boards, and 0.9 times if boards trace all rays.
const SHARE_MIN: f64 = 0.75;

/// A board that is connected, with its threads and the measured bandwidth of its cable.
#[derive(Clone, Debug, PartialEq)]
pub struct ConnectedBoard {
    /// Address of the board.
    pub name: String,
    /// Number of threads that trace rays on the board.
    pub threads: u64,
    /// Measured bandwidth of the cable in each direction, in bytes per second.
    pub bandwidth: f64,
}

impl ConnectedBoard {
    /// Returns the number of processors whose rays the board can trace.
    fn worth(&self) -> f64 {
        (self.threads as f64).min(self.bandwidth / BYTES_OF_PROCESSOR)
    }
}

/// Returns true if a picture is faster in waves, whose rays the boards trace, than in blocks without boards.
///
/// - `processors`: number of CPU threads that render.
pub(crate) fn are_worth_waves(boards: &[ConnectedBoard], processors: usize) -> bool {
    let worth: f64 = boards.iter().map(ConnectedBoard::worth).sum();
    !boards.is_empty() && worth >= SHARE_MIN * processors as f64
}

/// Returns the message that boards are not used, with the reason.
///
/// - `gpus`: names of the GPUs that render.
pub(crate) fn unused_boards_warning(boards: &[ConnectedBoard], processors: usize, gpus: &[String]) -> String {
    let named = |board: &ConnectedBoard| {
        let threads = counted(board.threads, "thread");
        format!("{} ({threads}, {:.1} MB/s)", board.name, board.bandwidth / 1e6)
    };
    let names: Vec<String> = boards.iter().map(named).collect();
    let verb = if boards.len() == 1 { "is" } else { "are" };
    let alone = format!("{} {verb} not used", names.join(", "));
    if !gpus.is_empty() {
        return format!(
            "{alone}: {} renders whole paths faster; `--set integrator.wavefront=true` uses boards anyway",
            gpus.join(", ")
        );
    }
    let needed = SHARE_MIN * processors as f64;
    let painting = counted(processors as u64, "processor");
    format!(
        "{alone}: beside {painting} boards save time from {} and {:.0} MB/s on; `--set integrator.wavefront=true` uses them anyway",
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
        ConnectedBoard { name: "tcp://render-2:7070".to_owned(), threads, bandwidth: megabytes * 1e6 }
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
    fn the_warning_says_why_a_board_is_not_used() {
        let message = unused_boards_warning(&[board(1, 5.0)], 4, &[]);
        assert!(message.starts_with("tcp://render-2:7070 (1 thread, 5.0 MB/s) is not used"), "{message}");
        assert!(message.contains("3 threads and 600 MB/s"), "{message}");
    }
}
