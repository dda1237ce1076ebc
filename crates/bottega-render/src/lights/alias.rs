//! Choice among many by weight, in constant time.

/// A distribution over the indices of a list, proportional to its weights.
///
/// Source: Vose 1991, *A Linear Algorithm for Generating Random Numbers with a Given Distribution*.
#[derive(Clone, Debug, Default)]
pub(crate) struct AliasTable {
    entries: Vec<Entry>,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    /// Below this part of the entry's cell the entry itself is meant, above it `alias`.
    threshold: f32,
    alias: u32,
    pmf: f32,
}

impl AliasTable {
    /// Memory that an index takes.
    pub(crate) const ENTRY_BYTES: usize = size_of::<Entry>();

    /// The table of these weights. Weights that are negative or not finite count as 0; when all are 0, it is empty.
    pub(crate) fn new(weights: &[f32]) -> Self {
        let sound = |w: f32| if w.is_finite() && w > 0.0 { f64::from(w) } else { 0.0 };
        let total: f64 = weights.iter().map(|&w| sound(w)).sum();
        if total == 0.0 {
            return Self::default();
        }
        let count = weights.len() as f64;
        let mut scaled: Vec<f64> = weights.iter().map(|&w| sound(w) / total * count).collect();
        let mut entries: Vec<Entry> = scaled
            .iter()
            .zip(0..)
            .map(|(&s, alias)| Entry { threshold: 1.0, alias, pmf: (s / count) as f32 })
            .collect();
        let (mut below, mut above): (Vec<usize>, Vec<usize>) = (0..weights.len()).partition(|&i| scaled[i] < 1.0);
        while let (Some(low), Some(&high)) = (below.pop(), above.last()) {
            entries[low].threshold = scaled[low] as f32;
            entries[low].alias = high as u32;
            scaled[high] -= 1.0 - scaled[low];
            if scaled[high] < 1.0 {
                above.pop();
                below.push(high);
            }
        }
        // Rounding may leave cells that are full but for a rest, and never one of weight 0 among them.
        let heaviest = (0..entries.len()).max_by(|&a, &b| entries[a].pmf.total_cmp(&entries[b].pmf)).unwrap_or(0);
        for i in below {
            if entries[i].pmf == 0.0 {
                entries[i] = Entry { threshold: 0.0, alias: heaviest as u32, pmf: 0.0 };
            }
        }
        Self { entries }
    }

    /// Whether there is nothing to choose.
    pub(crate) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The index that belongs to `u` in [0, 1), and its probability.
    #[inline]
    pub(crate) fn sample(&self, u: f32) -> Option<(usize, f32)> {
        let scaled = u * self.entries.len() as f32;
        let cell = (scaled as usize).min(self.entries.len().checked_sub(1)?);
        let entry = &self.entries[cell];
        let index = if scaled - (cell as f32) < entry.threshold { cell } else { entry.alias as usize };
        Some((index, self.entries[index].pmf))
    }

    /// The probability of an index.
    #[inline]
    pub(crate) fn pmf(&self, index: usize) -> f32 {
        self.entries.get(index).map_or(0.0, |entry| entry.pmf)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn indices_come_as_often_as_their_weight_says(weights in prop::collection::vec(0.0_f32..10.0, 1..20)) {
            let table = AliasTable::new(&weights);
            let total: f32 = weights.iter().sum();
            prop_assume!(total > 0.0);
            let mut counts = vec![0.0; weights.len()];
            let steps = 20_000;
            for i in 0..steps {
                let (index, pmf) = table.sample((i as f32 + 0.5) / steps as f32).unwrap();
                prop_assert!(pmf > 0.0);
                prop_assert_eq!(pmf, table.pmf(index));
                counts[index] += 1.0 / steps as f32;
            }
            for (count, weight) in counts.iter().zip(&weights) {
                prop_assert!((count - weight / total).abs() < 2e-3);
            }
        }
    }

    #[test]
    fn nothing_is_chosen_from_no_weight() {
        assert!(AliasTable::new(&[]).sample(0.5).is_none());
        assert!(AliasTable::new(&[0.0, f32::NAN, -1.0]).is_empty());
    }
}
