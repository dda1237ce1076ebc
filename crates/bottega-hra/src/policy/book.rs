//! The cost book: learned costs of primitives on resources, kept between runs. Text in, text out; the caller handles
//! files.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::cost::CostModel;
use crate::Primitive;

/// Version of the text's format; others are rejected.
const FORMAT: u32 = 1;
/// Maximum length of a text, in bytes.
const TEXT_MAX: usize = 1 << 20;

/// Learned costs by resource and primitive.
///
/// A resource is identified by its name without a trailing number: lanes of one processor share an entry. The version
/// says under which conditions the costs were learned (program version, and all else they depend on); costs of another
/// version are rejected, because they may be wrong without notice.
#[derive(Clone, Debug, PartialEq)]
pub struct CostBook {
    version: String,
    costs: BTreeMap<String, [CostModel; Primitive::COUNT]>,
}

/// An error in the text of a cost book.
#[derive(Debug, thiserror::Error)]
pub enum CostBookError {
    /// The text is longer than the maximum.
    #[error("the text has {0} bytes, more than a book of costs can have")]
    TooLong(usize),
    /// The text is not JSON, or has other fields.
    #[error("not a book of costs")]
    Syntax(#[source] serde_json::Error),
    /// The text has another version of the format.
    #[error("the book of costs has form {found}, not {FORMAT}")]
    Format {
        /// The version found.
        found: u32,
    },
    /// The costs were learned under another version.
    #[error("the costs were learnt by version `{found}`, not `{wanted}`")]
    Version {
        /// The version in the text.
        found: String,
        /// The expected version.
        wanted: String,
    },
    /// A number is invalid, or there is no such primitive.
    #[error("the cost of `{primitive}` on `{resource}` is not one")]
    Cost {
        /// The name of the resource.
        resource: String,
        /// The name of the primitive.
        primitive: String,
    },
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    format: u32,
    version: String,
    resources: BTreeMap<String, BTreeMap<String, BookEntry>>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct BookEntry {
    units: u64,
    items: u64,
    fixed_ns: f64,
    ns_per_item: f64,
    uncertainty: f64,
}

impl CostBook {
    /// Makes an empty book for costs learned under `version`.
    pub fn new(version: impl Into<String>) -> Self {
        Self { version: version.into(), costs: BTreeMap::new() }
    }

    /// Parses the JSON of [`CostBook::to_json`].
    ///
    /// - `version`: the version under which the costs must have been learned.
    ///
    /// # Errors
    /// The text is longer than 1 MiB, is not such JSON, has another format or version, an invalid cost, or an unknown
    /// primitive.
    pub fn from_json(text: &str, version: &str) -> Result<Self, CostBookError> {
        if text.len() > TEXT_MAX {
            return Err(CostBookError::TooLong(text.len()));
        }
        let text: Text = serde_json::from_str(text).map_err(CostBookError::Syntax)?;
        if text.format != FORMAT {
            return Err(CostBookError::Format { found: text.format });
        }
        if text.version != version {
            return Err(CostBookError::Version { found: text.version, wanted: version.to_owned() });
        }
        let mut book = Self::new(version);
        for (resource, entries) in text.resources {
            let mut costs = [CostModel::default(); Primitive::COUNT];
            for (name, entry) in entries {
                let primitive = Primitive::ALL.into_iter().find(|primitive| primitive.name() == name);
                let model = entry.model();
                let (Some(primitive), Some(model)) = (primitive, model) else {
                    return Err(CostBookError::Cost { resource, primitive: name });
                };
                costs[primitive.index()] = model;
            }
            book.costs.insert(resource, costs);
        }
        Ok(book)
    }

    /// Returns the book as JSON, without costs that were never measured.
    pub fn to_json(&self) -> String {
        let entries = |costs: &[CostModel; Primitive::COUNT]| {
            let known = Primitive::ALL.into_iter().filter(|primitive| costs[primitive.index()].units() > 0);
            known.map(|primitive| (primitive.name().to_owned(), BookEntry::of(&costs[primitive.index()]))).collect()
        };
        let resources = self.costs.iter().map(|(name, costs)| (name.clone(), entries(costs))).collect();
        let text = Text { format: FORMAT, version: self.version.clone(), resources };
        serde_json::to_string_pretty(&text).unwrap_or_default()
    }

    /// Returns the cost of a primitive on the resource of this name; `None`: it was never measured.
    pub fn get(&self, resource: &str, primitive: Primitive) -> Option<&CostModel> {
        let costs = self.costs.get(kind_of(resource))?;
        Some(&costs[primitive.index()]).filter(|cost| cost.units() > 0)
    }

    /// Sets the cost of a primitive on the resource of this name; of several lanes of one kind, the cost with the most
    /// measurements is kept.
    pub fn set(&mut self, resource: &str, primitive: Primitive, cost: CostModel) {
        let costs = self.costs.entry(kind_of(resource).to_owned()).or_default();
        let known = &mut costs[primitive.index()];
        if cost.units() >= known.units() {
            *known = cost;
        }
    }

    pub(crate) fn costs_of(&self, resource: &str) -> [CostModel; Primitive::COUNT] {
        self.costs.get(kind_of(resource)).copied().unwrap_or_default()
    }
}

impl BookEntry {
    fn of(cost: &CostModel) -> Self {
        Self {
            units: cost.units(),
            items: cost.items(),
            fixed_ns: cost.fixed_ns(),
            ns_per_item: cost.ns_per_item(),
            uncertainty: cost.uncertainty().unwrap_or(0.0),
        }
    }

    fn model(&self) -> Option<CostModel> {
        let sound = |value: f64| value.is_finite() && (0.0..1e18).contains(&value);
        let all = [self.fixed_ns, self.ns_per_item, self.uncertainty].into_iter().all(sound);
        (all && self.units > 0).then(|| {
            let miss = self.uncertainty.min(10.0).powi(2);
            CostModel::known(self.units, self.items, self.fixed_ns, self.ns_per_item, miss)
        })
    }
}

/// Returns a name without a trailing number.
fn kind_of(name: &str) -> &str {
    name.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::time::Duration;

    fn book() -> CostBook {
        let mut book = CostBook::new("1.0");
        for (name, ns_per_item) in [("cpu 0", 10), ("board", 3)] {
            let mut cost = CostModel::default();
            for size in [100_u64, 500, 900] {
                cost.observe(size, Duration::from_nanos(700 + ns_per_item * size));
            }
            book.set(name, Primitive::Intersect, cost);
        }
        book
    }

    #[test]
    fn what_is_written_is_read() {
        let read = CostBook::from_json(&book().to_json(), "1.0").expect("a book");
        for name in ["cpu 3", "board"] {
            let (before, after) = (book(), read.clone());
            let costs =
                [&before, &after].map(|book| book.get(name, Primitive::Intersect).expect("known").predict_ns(1_000));
            assert!((costs[0].unwrap() - costs[1].unwrap()).abs() < 1e-3, "{costs:?}");
        }
        assert_eq!(read.to_json(), CostBook::from_json(&read.to_json(), "1.0").expect("a book").to_json());
        assert!(read.get("cpu 0", Primitive::Occluded).is_none());
    }

    #[test]
    fn old_and_bad_text_is_an_error() {
        let text = book().to_json();
        assert!(matches!(CostBook::from_json(&text, "1.1"), Err(CostBookError::Version { .. })));
        let other_form = text.replace("\"format\": 1", "\"format\": 0");
        assert!(matches!(CostBook::from_json(&other_form, "1.0"), Err(CostBookError::Format { found: 0 })));
        let negative = text.replace("\"fixed_ns\": ", "\"fixed_ns\": -");
        assert!(matches!(CostBook::from_json(&negative, "1.0"), Err(CostBookError::Cost { .. })));
        let unknown = text.replace("\"intersect\"", "\"dance\"");
        assert!(matches!(CostBook::from_json(&unknown, "1.0"), Err(CostBookError::Cost { .. })));
        assert!(matches!(CostBook::from_json("{}", "1.0"), Err(CostBookError::Syntax(_))));
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(cut in 0_usize..600, with in "\\PC{0,8}") {
            let mut text = book().to_json();
            let cut = (0..=cut.min(text.len())).rev().find(|&at| text.is_char_boundary(at)).unwrap_or(0);
            text.truncate(cut);
            text.push_str(&with);
            let _ = CostBook::from_json(&text, "1.0");
        }
    }
}
