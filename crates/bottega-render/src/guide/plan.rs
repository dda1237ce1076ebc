//! The plan of a picture: which way of painting pays, and where.

/// A way to paint a pixel. All have the same mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum PaintingWay {
    /// As if nothing had been learnt.
    #[default]
    Plain,
    /// Directions are guided, and lights are chosen by agents.
    Guided,
    /// Beside that, paths are ended and split, and shadow rays left out, by what agents say they are worth.
    ByWorth,
}

impl PaintingWay {
    /// All ways, each at the place of its number.
    pub(crate) const ALL: [Self; 3] = [Self::Plain, Self::Guided, Self::ByWorth];

    /// Its place among all.
    #[inline(always)]
    pub(crate) fn number(self) -> usize {
        self as usize
    }
}

/// Ways by zones of the picture, which lie in columns and rows. Whatever it says, the mean of each pixel is the same: it was made
/// of samples that the picture does not have.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct PaintPlan {
    columns: u32,
    rows: u32,
    ways: Vec<PaintingWay>,
}

impl PaintPlan {
    /// `None`: they are not as many as columns times rows.
    pub(crate) fn new(columns: u32, rows: u32, ways: Vec<PaintingWay>) -> Option<Self> {
        let count = u64::from(columns) * u64::from(rows);
        (count == ways.len() as u64).then_some(Self { columns, rows, ways })
    }

    /// The number of the zone of a place in the picture, in [0, 1)², where the picture is cut into so many.
    #[inline(always)]
    pub(crate) fn zone([columns, rows]: [u32; 2], [x, y]: [f32; 2]) -> usize {
        let along = |place: f32, count: u32| ((place * count as f32) as u32).min(count.saturating_sub(1));
        (along(y, rows) * columns + along(x, columns)) as usize
    }

    /// The way at a place in the picture, in [0, 1)².
    #[inline(always)]
    pub(crate) fn at(&self, place: [f32; 2]) -> PaintingWay {
        self.ways.get(Self::zone([self.columns, self.rows], place)).copied().unwrap_or_default()
    }

    /// The way of the whole picture; `None`: zones differ.
    pub(crate) fn only_way(&self) -> Option<PaintingWay> {
        let first = self.ways.first().copied().unwrap_or_default();
        self.ways.iter().all(|&way| way == first).then_some(first)
    }

    /// Columns, rows, and the way of each zone.
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
