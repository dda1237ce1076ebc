//! Cells: squares of pixels, each of which stops when its own error is small enough.
//!
//! The grid of cells starts at the picture's first pixel and does not depend on zones, which are cut along it. A cell
//! depends on its own samples only, so a picture with an error goal is the same for any zones, agents and
//! interruptions.
//!
//! Sample counts grow in octaves: 8, 16, 32, 64 and so on, one order per zone and octave. Within an octave there are
//! four looks, at which the error is estimated from the difference between the samples since the octave began and those
//! before. The last look is one sample before the end of the octave, never at the end itself: so a cell has as many
//! samples as its zone if and only if it continues, and the tile alone shows which cells have stopped.

use bottega_image::{Layout, Rect, Tile};

use crate::{Goal, GoalRules, settings::CELL_SIDE};

/// Looks of an octave, in quarters of the samples at its beginning.
const LOOKS: [u32; 3] = [1, 2, 3];

/// Returns the sample count at which the octave after `samples` ends; at most `samples_max`.
pub(crate) fn octave_end(samples: u32, samples_max: u32) -> u32 {
    let end = samples.saturating_add(1).checked_next_power_of_two().unwrap_or(u32::MAX);
    end.max(Goal::FIRST_SAMPLES).min(samples_max)
}

/// Returns the look after `samples` that is nearest to `wanted`, in the octave that began at `begun` samples and ends
/// at `end`. `None`: the end is nearer.
fn next_look(samples: u32, wanted: u32, begun: u32, end: u32) -> Option<u32> {
    let quarters = LOOKS.map(|quarter| begun + begun / 4 * quarter);
    let last = begun.saturating_mul(2) - 1;
    let looks = quarters.into_iter().chain([last]).filter(|&look| look > samples && look < end);
    looks.chain([end]).min_by_key(|look| look.abs_diff(wanted)).filter(|&look| look < end)
}

/// The cells of a zone while it is painted to an error goal.
#[derive(Debug)]
pub(crate) struct Cells {
    cells: Vec<Cell>,
    rules: GoalRules,
    error_wanted: f64,
    samples_max: u32,
    /// The sample count at the beginning of the current octave, and the tile at that time. `None` before the first
    /// octave.
    before: Option<(u32, Tile)>,
    /// The tile before the samples in progress, from which stopped cells are restored.
    kept: Option<Tile>,
}

#[derive(Debug)]
struct Cell {
    rect: Rect,
    /// The look at which the cell may stop next, as a sample count; `None`: it continues to the end of the octave.
    look: Option<u32>,
    stopped: bool,
    error: Option<f64>,
}

/// The samples to paint next of a zone.
#[derive(Debug, PartialEq)]
pub(crate) struct NextSamples {
    /// The sample count to reach.
    pub(crate) end: u32,
    /// The pixels to paint; `None`: all of them.
    pub(crate) parts: Option<Vec<Rect>>,
}

impl Cells {
    /// Makes the cells of a zone that has no samples yet, or is at the end of an octave.
    pub(crate) fn new(rect: Rect, error_wanted: f64, samples_max: u32) -> Self {
        let cell = |rect| Cell { rect, look: None, stopped: false, error: None };
        let cells = grid(rect).map(cell).collect();
        Self { cells, rules: GoalRules::default(), error_wanted, samples_max, before: None, kept: None }
    }

    /// Returns the samples to paint after `samples`, whose sums `tile` holds, up to at most `end`. `None`: all cells
    /// have stopped.
    pub(crate) fn next(&mut self, samples: u32, tile: Option<&Tile>, end: u32) -> Option<NextSamples> {
        let octave_end = octave_end(samples, self.samples_max).min(end);
        let is_new = self.before.as_ref().is_none_or(|(begun, _)| samples >= begun.saturating_mul(2));
        // Begin a new octave
        if let Some(tile) = tile.filter(|_| is_new && samples >= Goal::FIRST_SAMPLES) {
            self.begin_octave(samples, tile, octave_end);
        }
        // Paint up to the next look of any running cell
        let going = || self.cells.iter().filter(|cell| !cell.stopped);
        let look = going().map(|cell| cell.look.unwrap_or(octave_end)).min()?;
        // Restrict the pixels to running cells, once some have stopped
        self.kept = tile.filter(|_| going().count() < self.cells.len()).cloned();
        let parts = self.kept.as_ref().map(|_| joined(going().map(|cell| cell.rect)));
        Some(NextSamples { end: look.min(octave_end), parts })
    }

    /// Marks the cells with fewer samples than the zone as stopped, and sets the first look of the others.
    fn begin_octave(&mut self, samples: u32, tile: &Tile, end: u32) {
        let look = next_look(samples, samples, samples, end);
        for cell in &mut self.cells {
            let taken = tile.pixel(cell.rect.x0, cell.rect.y0)[Layout::SAMPLE_COUNT];
            cell.stopped |= taken < samples as f32;
            cell.look = look;
        }
        self.before = Some((samples, tile.clone()));
    }

    /// Updates the cells after painting up to `samples`: restores stopped cells, then stops those whose error is small
    /// enough.
    pub(crate) fn painted(&mut self, samples: u32, tile: &mut Tile) {
        // Restore the cells that have stopped
        if let Some(kept) = self.kept.take() {
            self.cells.iter().filter(|cell| cell.stopped).for_each(|cell| copy(&kept, tile, &cell.rect));
        }
        let Some((begun, before)) = &self.before else { return };
        let end = octave_end(*begun, self.samples_max);
        let is_last = samples == self.samples_max;
        for cell in self.cells.iter_mut().filter(|cell| !cell.stopped) {
            // Skip the cells without a look at this sample count
            if !is_last && cell.look != Some(samples) {
                continue;
            }
            // Estimate the error and choose the next look, or stop
            let error = part(tile, &cell.rect).relative_error(&part(before, &cell.rect));
            cell.error = error.or(cell.error);
            let next = self.rules.next_samples(samples, self.samples_max, error, self.error_wanted);
            cell.stopped = next <= samples;
            cell.look = next_look(samples, next, *begun, end);
        }
    }

    /// Returns the share of the pixels whose cells continue after `samples`.
    pub(crate) fn unfinished(&self, samples: u32) -> f64 {
        let area = |all: bool| -> u64 {
            self.cells.iter().filter(|cell| all || !cell.stopped).map(|cell| cell.rect.area()).sum()
        };
        if samples >= self.samples_max { 0.0 } else { area(false) as f64 / area(true).max(1) as f64 }
    }

    /// Returns the greatest error estimated for any cell since [`Cells::new`].
    pub(crate) fn error(&self) -> Option<f64> {
        self.cells.iter().filter_map(|cell| cell.error).max_by(f64::total_cmp)
    }
}

/// Returns the cells of the picture's grid in a rectangle, clipped to it, row by row.
fn grid(rect: Rect) -> impl Iterator<Item = Rect> {
    let cuts = |from: u32, to: u32| {
        let first = from / CELL_SIDE;
        (first..to.div_ceil(CELL_SIDE))
            .map(move |i| (from.max(i * CELL_SIDE), to.min((i + 1).saturating_mul(CELL_SIDE))))
    };
    cuts(rect.y0, rect.y1).flat_map(move |(y0, y1)| cuts(rect.x0, rect.x1).map(move |(x0, x1)| Rect { x0, y0, x1, y1 }))
}

/// Joins adjacent cells of a row: the same pixels in fewer rectangles.
fn joined(cells: impl Iterator<Item = Rect>) -> Vec<Rect> {
    let mut all: Vec<Rect> = Vec::new();
    for cell in cells {
        match all.last_mut() {
            Some(last) if (last.y0, last.y1, last.x1) == (cell.y0, cell.y1, cell.x0) => last.x1 = cell.x1,
            _ => all.push(cell),
        }
    }
    all
}

fn part(tile: &Tile, rect: &Rect) -> Tile {
    let mut part = Tile::new(*rect, tile.layout().clone());
    part.copy_from(tile);
    part
}

fn copy(from: &Tile, to: &mut Tile, rect: &Rect) {
    to.copy_from(&part(from, rect));
}

#[cfg(test)]
mod tests {
    use bottega_image::{AovSet, SampleValues};

    use super::*;

    /// Values whose spread grows to the right: a function of pixel and sample alone.
    fn value(x: u32, y: u32, sample: u32) -> f32 {
        let mut bits = x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b) ^ sample.wrapping_mul(0xc2b2_ae35);
        for _ in 0..3 {
            bits = (bits ^ (bits >> 15)).wrapping_mul(0x2c1b_3c6d).rotate_left(7);
        }
        1.0 + x as f32 / 128.0 * ((bits >> 8) as f32 / (1 << 24) as f32 - 0.5)
    }

    fn add(tile: &mut Tile, rect: &Rect, samples: std::ops::Range<u32>) {
        for (x, y) in rect.pixels() {
            for sample in samples.clone() {
                let value = value(x, y, sample);
                tile.add(x, y, &SampleValues { radiance: [value; 3], ..SampleValues::default() });
            }
        }
    }

    /// Samples a zone to its end. `renews`: with a new `Cells` after each octave; `all`: without restriction to parts.
    fn paint(rect: Rect, wanted: f64, samples_max: u32, renews: bool, all: bool) -> (Tile, Option<f64>) {
        let mut tile = Tile::new(rect, Layout::new(AovSet::NONE));
        let mut cells = Cells::new(rect, wanted, samples_max);
        let mut samples = 0;
        while samples < samples_max {
            let end = octave_end(samples, samples_max);
            if renews {
                cells = Cells::new(rect, wanted, samples_max);
            }
            while samples < end
                && let Some(next) = cells.next(samples, (samples > 0).then_some(&tile), end)
            {
                let parts = next.parts.filter(|_| !all).unwrap_or(vec![rect]);
                parts.iter().for_each(|part| add(&mut tile, part, samples..next.end));
                samples = next.end;
                cells.painted(samples, &mut tile);
            }
            if cells.unfinished(samples) == 0.0 {
                break;
            }
        }
        (tile, cells.error())
    }

    fn counts(tile: &Tile) -> Vec<u32> {
        grid(tile.rect()).map(|cell| tile.pixel(cell.x0, cell.y0)[Layout::SAMPLE_COUNT] as u32).collect()
    }

    #[test]
    fn octaves_and_looks_are_where_they_should_be() {
        assert_eq!([0, 5, 8, 9, 16, 4000].map(|samples| octave_end(samples, 4096)), [8, 8, 16, 16, 32, 4096]);
        assert_eq!([octave_end(0, 3), octave_end(32, 50), octave_end(u32::MAX, u32::MAX)], [3, 50, u32::MAX]);
        let looks = |begun: u32, end: u32| -> Vec<u32> {
            std::iter::successors(next_look(begun, begun, begun, end), |&look| next_look(look, look, begun, end))
                .collect()
        };
        assert_eq!(looks(8, 16), [10, 12, 14, 15]);
        assert_eq!(looks(64, 128), [80, 96, 112, 127]);
        assert_eq!(looks(64, 100), [80, 96]);
        assert_eq!(
            [101, 107, 125, 128, 300].map(|wanted| next_look(80, wanted, 64, 128)),
            [Some(96), Some(112), Some(127), None, None]
        );
    }

    #[test]
    fn a_cell_stops_by_itself_whatever_the_zone() {
        let whole = Rect::of_size(200, 70);
        let (reference, error) = paint(whole, 0.01, 4096, false, false);
        assert!(error.is_some_and(|error| error <= 0.01), "{error:?}");
        let samples = counts(&reference);
        let (least, most) = (samples.iter().min().unwrap(), samples.iter().max().unwrap());
        assert!(4 * least < *most && *most < 4096, "the noise differs, and so do the samples: {samples:?}");
        assert!(samples.iter().all(|samples| !samples.is_power_of_two()), "{samples:?}");
        // In other zones, with a new painter after each octave that ignores the restriction to parts
        for zone in [Rect::new(0, 0, 64, 70), Rect::new(64, 0, 96, 32), Rect::new(96, 32, 200, 70)] {
            for (changes_painter, all) in [(false, false), (true, false), (false, true), (true, true)] {
                let (tile, _) = paint(zone, 0.01, 4096, changes_painter, all);
                assert!(tile == part(&reference, &zone), "{zone}: {changes_painter}, {all}");
            }
        }
    }

    #[test]
    fn nobody_goes_beyond_the_most_that_is_allowed() {
        let zone = Rect::of_size(64, 32);
        for samples_max in [1, 7, 8, 9, 50, 64] {
            let (tile, error) = paint(zone, 1e-9, samples_max, false, false);
            assert!(counts(&tile).iter().all(|samples| *samples == samples_max), "{samples_max}");
            assert_eq!(error.is_some(), samples_max > 8, "{samples_max}");
        }
    }

    #[test]
    fn what_has_no_error_stops_at_the_first_look() {
        // The first cell's leftmost pixels have none; a cell of one column has nothing else.
        let (tile, error) = paint(Rect::new(0, 0, 1, 32), 0.01, 4096, false, false);
        assert_eq!((counts(&tile), error), (vec![10], Some(0.0)));
    }

    #[test]
    fn the_grid_covers_a_rectangle_once_along_the_lines_of_the_picture() {
        let rect = Rect::new(40, 31, 130, 65);
        let cells: Vec<Rect> = grid(rect).collect();
        assert!(crate::Partition::covers(rect, &cells));
        assert_eq!(cells[0], Rect::new(40, 31, 64, 32));
        assert_eq!(joined(cells.into_iter()).len(), 3);
    }
}
