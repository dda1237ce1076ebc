//! The aggregate of all rules for one output and its defuzzification, both computed exactly, piece by piece.

use crate::{
    membership::{Membership, left_limit, right_limit},
    operators::{Accumulation, Activation, Method},
};

/// A term activated by a rule.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ActiveOutput<'a> {
    pub(crate) term: &'a Membership,
    pub(crate) activation: Activation,
    /// The degree of the rule, above 0 and at most 1.
    pub(crate) degree: f64,
}

/// A linear piece of the aggregate, x0 < x1. Steps lie between pieces.
#[derive(Clone, Copy, Debug, PartialEq)]
struct AggregatePiece {
    x0: f64,
    x1: f64,
    y0: f64,
    y1: f64,
}

/// The aggregate of all rules on one output, before defuzzification.
#[derive(Clone, Debug, PartialEq)]
pub enum Aggregate {
    /// (x, height), with non-decreasing x: one for each conclusion of a rule that fired, not accumulated. The height is
    /// the degree of the rule.
    Singletons(Vec<(f64, f64)>),
    /// The corners (x, y) of a piecewise linear function over the output's range, with non-decreasing x; two with equal
    /// x make a step. Empty: no rule with a conclusion about the output fired.
    Linear(Vec<(f64, f64)>),
}

/// Accumulates the activated terms; `range` and `activated` as for [`defuzzify`].
pub(crate) fn aggregate(accumulation: Accumulation, range: (f64, f64), activated: &[ActiveOutput<'_>]) -> Aggregate {
    let mut heights = singletons(activated);
    if !heights.is_empty() {
        heights.sort_by(|a, b| a.0.total_cmp(&b.0));
        return Aggregate::Singletons(heights);
    }
    if activated.is_empty() {
        return Aggregate::Linear(Vec::new());
    }
    let mut corners: Vec<(f64, f64)> = Vec::new();
    for piece in pieces(accumulation, range, activated) {
        for corner in [(piece.x0, piece.y0), (piece.x1, piece.y1)] {
            if let [.., before, last] = corners[..]
                && lies_between(last, before, corner)
            {
                corners.pop();
            }
            if corners.last() != Some(&corner) {
                corners.push(corner);
            }
        }
    }
    Aggregate::Linear(corners)
}

/// Returns true if a corner lies on the line between its neighbors, and can be dropped.
fn lies_between((x, y): (f64, f64), (x0, y0): (f64, f64), (x1, y1): (f64, f64)) -> bool {
    /// Far below any visible difference, far above rounding errors.
    const TOLERANCE: f64 = 1e-12;
    x0 < x && x < x1 && (y0 + (y1 - y0) * ((x - x0) / (x1 - x0)) - y).abs() < TOLERANCE
}

fn singletons(activated: &[ActiveOutput<'_>]) -> Vec<(f64, f64)> {
    let height = |one: &ActiveOutput<'_>| match one.term {
        Membership::Singleton(at) => Some((*at, one.degree)),
        Membership::Linear(_) => None,
    };
    activated.iter().filter_map(height).collect()
}

/// Defuzzifies the activated terms. `None`: nothing was concluded within the range.
///
/// - `range`: the interval of integration, ends in order.
/// - `activated`: either all singletons, or none, as the parser ensures.
pub(crate) fn defuzzify(
    method: Method,
    accumulation: Accumulation,
    range: (f64, f64),
    activated: &[ActiveOutput<'_>],
) -> Option<f64> {
    let singletons = singletons(activated);
    if !singletons.is_empty() {
        return of_singletons(method, accumulation, singletons);
    }
    let pieces = pieces(accumulation, range, activated);
    let value = match method {
        Method::Cog | Method::Cogs => center_of_gravity(&pieces),
        Method::Coa => center_of_area(&pieces),
        Method::Lm => maximum(&pieces).map(|(left, _)| left),
        Method::Rm => maximum(&pieces).map(|(_, right)| right),
        Method::Mm => maximum(&pieces).map(|(left, right)| left + 0.5 * (right - left)),
    };
    value.map(|value| value.clamp(range.0, range.1))
}

fn of_singletons(method: Method, accumulation: Accumulation, mut heights: Vec<(f64, f64)>) -> Option<f64> {
    if matches!(method, Method::Cog | Method::Cogs | Method::Coa) {
        let weight: f64 = heights.iter().map(|(_, w)| w).sum();
        return (weight > 0.0).then(|| heights.iter().map(|(x, w)| x * (w / weight)).sum());
    }
    heights.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut joined: Vec<(f64, f64)> = Vec::new();
    for (x, w) in heights {
        match joined.last_mut() {
            Some((last, height)) if *last == x => match accumulation {
                Accumulation::Max => *height = height.max(w),
                Accumulation::Bsum => *height = (*height + w).min(1.0),
                // The common divisor does not move the maximum
                Accumulation::Nsum => *height += w,
            },
            _ => joined.push((x, w)),
        }
    }
    let greatest = joined.iter().map(|(_, w)| *w).fold(0.0, f64::max);
    let left = joined.iter().find(|(_, w)| *w == greatest)?.0;
    let right = joined.iter().rfind(|(_, w)| *w == greatest)?.0;
    Some(match method {
        Method::Lm => left,
        Method::Rm => right,
        _ => left + 0.5 * (right - left),
    })
}

/// Returns the aggregate as linear pieces that cover the range from left to right.
fn pieces(accumulation: Accumulation, range: (f64, f64), activated: &[ActiveOutput<'_>]) -> Vec<AggregatePiece> {
    // Cut the range wherever one of the functions bends
    let mut cuts = vec![range.0, range.1];
    for one in activated {
        let Membership::Linear(points) = one.term else { continue };
        cuts.extend(points.iter().map(|point| point.0));
        if one.activation == Activation::Min {
            cuts.extend(points.windows(2).filter_map(|pair| crossing(pair[0], pair[1], one.degree)));
        }
    }
    cuts.retain(|x| (range.0..=range.1).contains(x));
    cuts.sort_by(f64::total_cmp);
    cuts.dedup();

    let mut pieces = Vec::with_capacity(cuts.len() * 2);
    let mut lines = Vec::with_capacity(activated.len());
    for pair in cuts.windows(2) {
        let (x0, x1) = (pair[0], pair[1]);
        lines.clear();
        lines.extend(activated.iter().filter_map(|one| line(one, x0, x1)));
        match accumulation {
            Accumulation::Max => push_envelope(x0, x1, &lines, &mut pieces),
            Accumulation::Bsum => push_bounded(sum(x0, x1, &lines), &mut pieces),
            Accumulation::Nsum => pieces.push(sum(x0, x1, &lines)),
        }
    }
    if accumulation == Accumulation::Nsum {
        let greatest = pieces.iter().fold(1.0_f64, |greatest, piece| greatest.max(piece.y0).max(piece.y1));
        for piece in &mut pieces {
            piece.y0 /= greatest;
            piece.y1 /= greatest;
        }
    }
    pieces
}

/// Returns the values of an activated term right of `x0` and left of `x1`, between which it is linear.
fn line(one: &ActiveOutput<'_>, x0: f64, x1: f64) -> Option<(f64, f64)> {
    let Membership::Linear(points) = one.term else { return None };
    let (y0, y1) = (right_limit(points, x0), left_limit(points, x1));
    Some(match one.activation {
        Activation::Min => (y0.min(one.degree), y1.min(one.degree)),
        Activation::Prod => (y0 * one.degree, y1 * one.degree),
    })
}

/// Returns the x where the line between two points crosses a height, strictly between them.
fn crossing((x0, y0): (f64, f64), (x1, y1): (f64, f64), height: f64) -> Option<f64> {
    let crosses = (y0 < height && height < y1) || (y1 < height && height < y0);
    let x = x0 + (x1 - x0) * ((height - y0) / (y1 - y0));
    (crosses && x0 < x && x < x1).then_some(x)
}

/// Appends the upper envelope of lines on one interval.
fn push_envelope(x0: f64, x1: f64, lines: &[(f64, f64)], pieces: &mut Vec<AggregatePiece>) {
    let at = |(y0, y1): (f64, f64), x: f64| y0 + (y1 - y0) * ((x - x0) / (x1 - x0));
    let mut cuts = vec![x0, x1];
    for (i, a) in lines.iter().enumerate() {
        for b in &lines[i + 1..] {
            cuts.extend(crossing((x0, a.0 - b.0), (x1, a.1 - b.1), 0.0));
        }
    }
    cuts.sort_by(f64::total_cmp);
    cuts.dedup();
    let top = |x: f64| lines.iter().map(|&line| at(line, x)).fold(0.0, f64::max);
    // Take the values at the ends as given, without interpolation
    let first = lines.iter().map(|line| line.0).fold(0.0, f64::max);
    let last = lines.iter().map(|line| line.1).fold(0.0, f64::max);
    for pair in cuts.windows(2) {
        let y0 = if pair[0] == x0 { first } else { top(pair[0]) };
        let y1 = if pair[1] == x1 { last } else { top(pair[1]) };
        pieces.push(AggregatePiece { x0: pair[0], x1: pair[1], y0, y1 });
    }
}

fn sum(x0: f64, x1: f64, lines: &[(f64, f64)]) -> AggregatePiece {
    AggregatePiece { x0, x1, y0: lines.iter().map(|line| line.0).sum(), y1: lines.iter().map(|line| line.1).sum() }
}

/// Appends a piece, bounded by 1.
fn push_bounded(piece: AggregatePiece, pieces: &mut Vec<AggregatePiece>) {
    let AggregatePiece { x0, x1, y0, y1 } = piece;
    match crossing((x0, y0), (x1, y1), 1.0) {
        Some(x) => {
            pieces.push(AggregatePiece { x0, x1: x, y0: y0.min(1.0), y1: 1.0 });
            pieces.push(AggregatePiece { x0: x, x1, y0: 1.0, y1: y1.min(1.0) });
        }
        None => pieces.push(AggregatePiece { x0, x1, y0: y0.min(1.0), y1: y1.min(1.0) }),
    }
}

impl AggregatePiece {
    fn area(&self) -> f64 {
        0.5 * (self.y0 + self.y1) * (self.x1 - self.x0)
    }
}

fn center_of_gravity(pieces: &[AggregatePiece]) -> Option<f64> {
    let origin = pieces.first()?.x0;
    let (mut area, mut moment) = (0.0, 0.0);
    for piece in pieces {
        // Take moments about the left end of the range, so that distant ranges lose no digits
        let (x0, x1) = (piece.x0 - origin, piece.x1 - origin);
        area += piece.area();
        moment += (x1 - x0) * (piece.y0 * (2.0 * x0 + x1) + piece.y1 * (x0 + 2.0 * x1)) / 6.0;
    }
    (area > 0.0).then(|| origin + moment / area)
}

fn center_of_area(pieces: &[AggregatePiece]) -> Option<f64> {
    let half = 0.5 * pieces.iter().map(AggregatePiece::area).sum::<f64>();
    let mut before = 0.0;
    for piece in pieces {
        let area = piece.area();
        if area > 0.0 && before + area >= half {
            // Solve y0 t + s t²/2 = rest for t, in the form without cancellation
            let rest = half - before;
            let slope = (piece.y1 - piece.y0) / (piece.x1 - piece.x0);
            let root = (piece.y0 * piece.y0 + 2.0 * slope * rest).max(0.0).sqrt();
            let t = if rest > 0.0 { 2.0 * rest / (piece.y0 + root) } else { 0.0 };
            return Some((piece.x0 + t).min(piece.x1));
        }
        before += area;
    }
    None
}

/// Returns the leftmost and the rightmost point of the aggregate's maximum.
fn maximum(pieces: &[AggregatePiece]) -> Option<(f64, f64)> {
    /// Heights that differ by less are equal: a truncated plateau is computed from several pieces.
    const TOLERANCE: f64 = 1e-12;
    let greatest = pieces.iter().map(|piece| piece.y0.max(piece.y1)).fold(0.0, f64::max);
    if greatest <= 0.0 {
        return None;
    }
    let is_greatest = |y: f64| y >= greatest - TOLERANCE;
    let left = pieces.iter().find_map(|piece| {
        if is_greatest(piece.y0) { Some(piece.x0) } else { is_greatest(piece.y1).then_some(piece.x1) }
    })?;
    let right = pieces.iter().rev().find_map(|piece| {
        if is_greatest(piece.y1) { Some(piece.x1) } else { is_greatest(piece.y0).then_some(piece.x0) }
    })?;
    Some((left, right))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn linear(points: &[(f64, f64)]) -> Membership {
        Membership::Linear(points.to_vec())
    }

    /// The same by brute force: midpoint rule.
    fn sampled(accumulation: Accumulation, range: (f64, f64), activated: &[ActiveOutput<'_>], method: Method) -> f64 {
        const STEPS: usize = 20_000;
        let step = (range.1 - range.0) / STEPS as f64;
        let sum_at = |x: f64| {
            let degrees = activated.iter().map(|one| match one.activation {
                Activation::Min => one.term.degree(x).min(one.degree),
                Activation::Prod => one.term.degree(x) * one.degree,
            });
            match accumulation {
                Accumulation::Max => degrees.fold(0.0, f64::max),
                Accumulation::Bsum => degrees.sum::<f64>().min(1.0),
                Accumulation::Nsum => degrees.sum(),
            }
        };
        let xs = (0..STEPS).map(|i| range.0 + (i as f64 + 0.5) * step);
        let samples: Vec<(f64, f64)> = xs.map(|x| (x, sum_at(x))).collect();
        let area: f64 = samples.iter().map(|(_, y)| y).sum();
        if method == Method::Cog {
            return samples.iter().map(|(x, y)| x * y).sum::<f64>() / area;
        }
        let mut before = 0.0;
        for (x, y) in samples {
            before += y;
            if before >= area / 2.0 {
                return x;
            }
        }
        range.1
    }

    fn any_term() -> impl Strategy<Value = Membership> {
        prop::collection::vec((0.0..10.0, 0.0..=1.0), 1..6).prop_map(|mut points: Vec<(f64, f64)>| {
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            Membership::Linear(points)
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn exact_centers_agree_with_fine_sampling(
            terms in prop::collection::vec((any_term(), 0.05..=1.0, any::<bool>()), 1..5),
            accumulation in prop::sample::select(Accumulation::ALL),
        ) {
            let activated: Vec<ActiveOutput<'_>> = terms.iter().map(|(term, degree, cut)| ActiveOutput {
                term,
                degree: *degree,
                activation: if *cut { Activation::Min } else { Activation::Prod },
            }).collect();
            let range = (0.0, 10.0);
            let area: f64 = pieces(accumulation, range, &activated).iter().map(AggregatePiece::area).sum();
            prop_assume!(area > 0.5);
            for method in [Method::Cog, Method::Coa] {
                let exact = defuzzify(method, accumulation, range, &activated).unwrap();
                let near = sampled(accumulation, range, &activated, method);
                // COA may lie anywhere in a gap without area; what counts is that it halves the area.
                if method == Method::Cog {
                    prop_assert!((exact - near).abs() < 5e-3, "{method:?}: {exact} {near}");
                } else {
                    let left = area_until(&pieces(accumulation, range, &activated), exact);
                    prop_assert!((left - area / 2.0).abs() < 1e-9, "{left} of {area}; {near}");
                }
            }
        }
    }

    fn area_until(pieces: &[AggregatePiece], x: f64) -> f64 {
        pieces
            .iter()
            .filter(|piece| piece.x0 < x)
            .map(|piece| {
                let end = piece.x1.min(x);
                let t = (end - piece.x0) / (piece.x1 - piece.x0);
                let y = piece.y0 + (piece.y1 - piece.y0) * t;
                0.5 * (piece.y0 + y) * (end - piece.x0)
            })
            .sum()
    }

    #[test]
    fn a_triangle_has_its_known_centers() {
        // Right triangle with the right angle at 3: centroid at 2/3, half of the area at 3/√2.
        let term = linear(&[(0.0, 0.0), (3.0, 1.0), (3.0, 0.0)]);
        let one = [ActiveOutput { term: &term, activation: Activation::Prod, degree: 0.5 }];
        let by = |method| defuzzify(method, Accumulation::Max, (0.0, 9.0), &one).unwrap();
        assert!((by(Method::Cog) - 2.0).abs() < 1e-12);
        assert!((by(Method::Coa) - 3.0 / 2.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!((by(Method::Lm), by(Method::Rm), by(Method::Mm)), (3.0, 3.0, 3.0));
    }

    #[test]
    fn maxima_of_a_cut_off_trapezoid_are_the_ends_of_its_plateau() {
        let term = linear(&[(0.0, 0.0), (2.0, 1.0), (4.0, 1.0), (6.0, 0.0)]);
        let one = [ActiveOutput { term: &term, activation: Activation::Min, degree: 0.5 }];
        let by = |method| defuzzify(method, Accumulation::Max, (0.0, 9.0), &one).unwrap();
        assert_eq!((by(Method::Lm), by(Method::Rm), by(Method::Mm)), (1.0, 5.0, 3.0));
    }

    #[test]
    fn singletons_weigh_and_the_highest_is_the_maximum() {
        let terms = [1.0, 1.0, 4.0].map(Membership::Singleton);
        let degrees = [0.4, 0.4, 0.6];
        let all: Vec<_> = terms
            .iter()
            .zip(degrees)
            .map(|(term, degree)| ActiveOutput { term, activation: Activation::Min, degree })
            .collect();
        let by = |method, accumulation| defuzzify(method, accumulation, (0.0, 9.0), &all).unwrap();
        assert!((by(Method::Cogs, Accumulation::Max) - (0.8 + 2.4) / 1.4).abs() < 1e-12);
        assert_eq!(by(Method::Lm, Accumulation::Max), 4.0);
        assert_eq!(by(Method::Lm, Accumulation::Bsum), 1.0);
    }

    #[test]
    fn an_aggregate_has_the_corners_that_one_would_draw() {
        let (low, high) = (linear(&[(0.0, 1.0), (2.0, 1.0), (4.0, 0.0)]), linear(&[(2.0, 0.0), (4.0, 1.0)]));
        let cut = [(&low, 0.5), (&high, 1.0)].map(|(term, degree)| ActiveOutput {
            term,
            activation: Activation::Min,
            degree,
        });
        let drawn = |accumulation| aggregate(accumulation, (0.0, 5.0), &cut);
        let corners = vec![(0.0, 0.5), (3.0, 0.5), (4.0, 1.0), (5.0, 1.0)];
        assert_eq!(drawn(Accumulation::Max), Aggregate::Linear(corners));
        let corners = vec![(0.0, 0.5), (2.0, 0.5), (3.0, 1.0), (5.0, 1.0)];
        assert_eq!(drawn(Accumulation::Bsum), Aggregate::Linear(corners));
        assert_eq!(aggregate(Accumulation::Max, (0.0, 5.0), &[]), Aggregate::Linear(Vec::new()));
    }

    #[test]
    fn nothing_concluded_or_no_area_gives_no_value() {
        assert_eq!(defuzzify(Method::Cog, Accumulation::Max, (0.0, 1.0), &[]), None);
        let outside = linear(&[(4.0, 0.0), (5.0, 1.0)]);
        let one = [ActiveOutput { term: &outside, activation: Activation::Min, degree: 1.0 }];
        for &method in Method::ALL {
            assert_eq!(defuzzify(method, Accumulation::Bsum, (0.0, 1.0), &one), None, "{method:?}");
        }
    }
}
