//! The operators of rule blocks and outputs (IEC 61131-7, tables of AND, OR, ACT, ACCU and METHOD).

/// The AND of degrees: a triangular norm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum And {
    /// Minimum: min(a, b).
    #[default]
    Min,
    /// Product: a · b.
    Prod,
    /// Bounded difference: max(0, a + b − 1).
    Bdif,
}

/// The OR of degrees: a triangular conorm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Or {
    /// Maximum: max(a, b).
    #[default]
    Max,
    /// Algebraic sum: a + b − a · b.
    Asum,
    /// Bounded sum: min(1, a + b).
    Bsum,
}

/// The effect of a rule's degree on the term it concludes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Activation {
    /// Truncates the term: min(w, μ), for a degree w of the rule and a degree μ of the term.
    #[default]
    Min,
    /// Scales the term: w · μ.
    Prod,
}

/// The accumulation of the conclusions of all rules on one output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Accumulation {
    /// The maximum at each point.
    #[default]
    Max,
    /// Bounded sum: min(1, sum).
    Bsum,
    /// Normalized sum: sum / max(1, greatest sum anywhere). Tools differ in its definition.
    Nsum,
}

/// The method of defuzzification: makes a single number of the accumulated conclusions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The center of gravity of the area.
    Cog,
    /// The center of gravity of singletons.
    Cogs,
    /// The center of area: the point that halves the area.
    Coa,
    /// The leftmost point of the maximum.
    Lm,
    /// The rightmost point of the maximum.
    Rm,
    /// The mean of the leftmost and the rightmost point of the maximum.
    Mm,
}

impl And {
    /// Returns the conjunction of two degrees; all are 0..=1.
    pub fn join(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Min => a.min(b),
            Self::Prod => a * b,
            Self::Bdif => (a + b - 1.0).max(0.0),
        }
    }

    /// Returns the dual conorm, with which De Morgan's laws hold.
    pub fn dual(self) -> Or {
        match self {
            Self::Min => Or::Max,
            Self::Prod => Or::Asum,
            Self::Bdif => Or::Bsum,
        }
    }
}

impl Or {
    /// Returns the disjunction of two degrees; all are 0..=1.
    pub fn join(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Max => a.max(b),
            // Equals a + b − a·b, but rounding never makes it exceed 1.
            Self::Asum => 1.0 - (1.0 - a) * (1.0 - b),
            Self::Bsum => (a + b).min(1.0),
        }
    }

    /// Returns the dual norm, with which De Morgan's laws hold.
    pub fn dual(self) -> And {
        match self {
            Self::Max => And::Min,
            Self::Asum => And::Prod,
            Self::Bsum => And::Bdif,
        }
    }
}

macro_rules! words {
    ($type:ident { $($variant:ident = $word:literal),+ }) => {
        impl $type {
            /// All variants, in the order of their declaration.
            pub const ALL: &[Self] = &[$(Self::$variant),+];

            /// Returns the keyword of the operator or method in FCL, such as `MIN`.
            pub fn word(self) -> &'static str {
                match self { $(Self::$variant => $word),+ }
            }
        }
    };
}

words!(And { Min = "MIN", Prod = "PROD", Bdif = "BDIF" });
words!(Or { Max = "MAX", Asum = "ASUM", Bsum = "BSUM" });
words!(Activation { Min = "MIN", Prod = "PROD" });
words!(Accumulation { Max = "MAX", Bsum = "BSUM", Nsum = "NSUM" });
words!(Method { Cog = "COG", Cogs = "COGS", Coa = "COA", Lm = "LM", Rm = "RM", Mm = "MM" });

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_pairs_are_dual_by_de_morgan(a in 0.0..=1.0, b in 0.0..=1.0) {
            for &and in And::ALL {
                let or = and.dual();
                prop_assert_eq!(or.dual(), and);
                prop_assert!((1.0 - and.join(a, b) - or.join(1.0 - a, 1.0 - b)).abs() < 1e-12);
            }
        }

        #[test]
        fn norms_commute_grow_and_keep_within_their_bounds(a in 0.0..=1.0, b in 0.0..=1.0, c in 0.0..=1.0) {
            let (low, high) = if b < c { (b, c) } else { (c, b) };
            for &and in And::ALL {
                prop_assert_eq!(and.join(a, b), and.join(b, a));
                prop_assert!(and.join(a, low) <= and.join(a, high));
                prop_assert!(and.join(a, b) <= a.min(b) && and.join(a, b) >= 0.0);
                prop_assert!((and.join(a, 1.0) - a).abs() < 1e-12);
                prop_assert!((and.join(and.join(a, b), c) - and.join(a, and.join(b, c))).abs() < 1e-12);
            }
            for &or in Or::ALL {
                prop_assert_eq!(or.join(a, b), or.join(b, a));
                prop_assert!(or.join(a, low) <= or.join(a, high));
                prop_assert!(or.join(a, b) >= a.max(b) - 1e-15 && or.join(a, b) <= 1.0);
                prop_assert!((or.join(a, 0.0) - a).abs() < 1e-12);
            }
        }
    }
}
