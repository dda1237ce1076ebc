//! The plan of a picture: the way of rendering that pays off in each zone.

/// A way to render a pixel. All ways have the same mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum PaintingWay {
    /// Paths without the guide.
    #[default]
    Plain,
    /// Paths with guided directions and lights chosen by agents.
    Guided,
    /// Guided paths with roulette, splitting and skipped shadow rays by the agents' importance.
    ByWorth,
}

impl PaintingWay {
    /// All ways, indexed by their numbers.
    pub(crate) const ALL: [Self; 3] = [Self::Plain, Self::Guided, Self::ByWorth];

    /// Returns the index in [`Self::ALL`].
    #[inline(always)]
    pub(crate) fn number(self) -> usize {
        self as usize
    }
}

/// Ways of rendering in a grid of zones. No plan changes the mean of a pixel: it is made from samples that the picture
/// does not use.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct PaintPlan {
    columns: u32,
    rows: u32,
    ways: Vec<PaintingWay>,
}

impl PaintPlan {
    /// Creates a plan; `None`: the number of ways is not columns times rows.
    pub(crate) fn new(columns: u32, rows: u32, ways: Vec<PaintingWay>) -> Option<Self> {
        let count = u64::from(columns) * u64::from(rows);
        (count == ways.len() as u64).then_some(Self { columns, rows, ways })
    }

    /// Returns the index of the zone of a position in the picture, in [0, 1)², in a grid of columns and rows.
    #[inline(always)]
    pub(crate) fn zone([columns, rows]: [u32; 2], [x, y]: [f32; 2]) -> usize {
        let along = |place: f32, count: u32| ((place * count as f32) as u32).min(count.saturating_sub(1));
        (along(y, rows) * columns + along(x, columns)) as usize
    }

    /// Returns the way at a position in the picture, in [0, 1)².
    #[inline(always)]
    pub(crate) fn at(&self, place: [f32; 2]) -> PaintingWay {
        self.ways.get(Self::zone([self.columns, self.rows], place)).copied().unwrap_or_default()
    }

    /// Returns the way of the whole picture; `None`: zones differ.
    pub(crate) fn only_way(&self) -> Option<PaintingWay> {
        let first = self.ways.first().copied().unwrap_or_default();
        self.ways.iter().all(|&way| way == first).then_some(first)
    }

    /// Returns columns, rows, and the way of each zone.
    pub(super) fn parts(&self) -> (u32, u32, &[PaintingWay]) {
        (self.columns, self.rows, &self.ways)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_has_the_way_of_its_zone() {
        use PaintingWay::{ByWorth, Guided, Plain};
        let plan = PaintPlan::new(2, 2, vec![Plain, Guided, ByWorth, Plain]).unwrap();
        assert_eq!(
            [[0.1, 0.1], [0.9, 0.1], [0.1, 0.9], [0.5, 0.5]].map(|at| plan.at(at)),
            [Plain, Guided, ByWorth, Plain]
        );
        assert_eq!(plan.at([1.0, 0.0]), Guided, "what is beyond the edge counts as next to it");
        assert_eq!((plan.only_way(), PaintPlan::new(2, 1, vec![Guided; 2]).unwrap().only_way()), (None, Some(Guided)));
        assert_eq!(PaintPlan::default().at([0.5, 0.5]), Plain);
        assert!(PaintPlan::new(2, 2, vec![Plain]).is_none());
        assert!(PaintingWay::ALL.iter().enumerate().all(|(number, way)| way.number() == number));
    }
}
