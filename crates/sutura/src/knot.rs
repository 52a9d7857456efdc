//! Which knot is it: recognition from a polyline, closed, held at its ends, or free.
//!
//! The polyline is closed, thinned by moves that cannot change the knot (`reduce`), seen from several directions, and
//! each view is simplified and cut into connected summands (`diagram`). A summand is named only when its invariants and
//! its number of crossings leave one knot: the square knot shares determinant, signature and Alexander polynomial with
//! 8_20, so it is named from two summands of three crossings and from nothing else. What is not certain is
//! [`KnotType::Unknown`], with its invariants.
//!
//! Also here: writhe and linking number ([`writhe`], [`gauss_linking`]) and the places where a thread enters its knot
//! ([`entries`]).
//!
//! Topology does not tell a flat square knot from one that has capsized into sliding half hitches; [`form`] does, by
//! how the two strands share the turning.

mod diagram;
mod entries;
mod form;
mod linking;
mod reduce;
pub(crate) mod space;

pub use entries::{Entries, entries};
pub use form::{Form, Verdict, form, form_of_strands, form_of_two};
pub use linking::{gauss_linking, writhe};

use core::fmt;
use diagram::{Diagram, Invariants};
use glam::{DQuat, DVec3};

/// How the ends of the polyline are joined.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ends {
    /// The last point is joined to the first (which may be given twice).
    Closed,
    /// Each end goes on along a ray to far away, where the rays are joined: the outward directions at the grips. Any
    /// length but zero.
    Held {
        /// Outward direction at the first point.
        start: DVec3,
        /// Outward direction at the last point.
        end: DVec3,
    },
    /// Each end goes on along a random ray, chosen anew for each of 24 closures among the directions that lead away
    /// from the middle of the thread. Where the closures disagree the tails are trimmed, a twentieth of the length from
    /// each end at a time and at most a quarter; trimming may make an answer certain, it may not change it.
    Free,
}

/// Right- or left-handed. A right-handed throw has positive crossings and negative signature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Hand {
    /// Right-handed.
    Right,
    /// Left-handed.
    Left,
}

/// How many throws of 3, 5, 7 and 9 crossings (single, double, triple, quadruple) are stacked. Topology keeps no order.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Throws {
    /// Right-handed ones.
    pub right: [u8; 4],
    /// Left-handed ones.
    pub left: [u8; 4],
}

/// The knots that this module names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum KnotType {
    /// No knot.
    Unknot,
    /// One throw: overhand knot, 3_1.
    Trefoil(Hand),
    /// Figure-eight knot, 4_1.
    FigureEight,
    /// The surgeon's double throw alone, 5_1.
    Cinquefoil(Hand),
    /// Two throws, mirrored.
    Square,
    /// Two equal throws.
    Granny(Hand),
    /// A double throw of this hand, then a single one mirrored: the surgeon's knot.
    SurgeonSquare(Hand),
    /// A double throw and a single one of the same hand.
    SurgeonGranny(Hand),
    /// A square knot and a further throw of this hand.
    SquareAndThrow(Hand),
    /// Three equal throws.
    ThreeEqualThrows(Hand),
    /// A double throw of this hand and a square knot: the surgeon's knot with a further throw, each the mirror of the
    /// one before.
    SurgeonSquareAndThrow(Hand),
    /// A triple throw alone, 7_1.
    TripleThrow(Hand),
    /// A quadruple throw alone, 9_1.
    QuadrupleThrow(Hand),
    /// Another stack of throws.
    Throws(Throws),
    /// None of these, or not certain.
    Unknown,
}

/// Why there is no answer beyond [`KnotType::Unknown`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Problem {
    /// Fewer than two different points (three when closed).
    TooFewPoints,
    /// A coordinate or direction is not a finite number, or a direction is zero.
    NotFinite,
    /// No view in general position: the thread meets itself.
    Degenerate,
    /// More crossings than the arithmetic holds are left after simplification.
    TooTangled,
    /// The views or closures agree on less than 90 %.
    Disagreement,
}

/// What was recognized, and how certainly.
#[derive(Debug, Clone, PartialEq)]
pub struct Recognition {
    /// The knot.
    pub knot: KnotType,
    /// |Alexander polynomial at -1|; 0 when it could not be computed.
    pub determinant: u64,
    /// Signature, negative for right-handed throws.
    pub signature: i32,
    /// Alexander polynomial from the constant coefficient on, the last one positive; empty when it could not be
    /// computed.
    pub alexander: Vec<i64>,
    /// Crossings left after simplification, in the simplest view found.
    pub crossings: usize,
    /// Its prime parts in the order of the tables, such as `3_1 # m3_1`; right-handed ones without `m`, `?` for a part
    /// without a name.
    pub notation: String,
    /// Views whose invariants are those of the answer.
    pub projections_agreed: u32,
    /// Views taken.
    pub projections_total: u32,
    /// Closures that gave the answer.
    pub closures_agreed: u32,
    /// Closures tried: 24 for free ends, otherwise 1.
    pub closures_total: u32,
    /// Part of the length cut from each end before closing, 0 to 0.25.
    pub trimmed: f64,
    /// What was wrong, if anything.
    pub problem: Option<Problem>,
}

/// Views of each closure.
const PROJECTIONS: u32 = 4;
/// Random closures of free ends.
const CLOSURES: usize = 24;
/// Agreement below which there is no answer.
const AGREEMENT: f64 = 0.9;
/// Crossings of a summand beyond which its invariants may overflow, and would take long.
const MOST_CROSSINGS: usize = 32;

/// Recognizes a polyline. `seed` chooses the views and the closures; the same seed gives the same answer. Takes a few
/// milliseconds for a thousand points. The units of `points` do not matter. Input that cannot be recognized gives
/// [`KnotType::Unknown`] and a [`Problem`].
pub fn recognize(points: &[DVec3], ends: Ends, seed: u64) -> Recognition {
    let directions_fit = match ends {
        Ends::Held { start, end } => {
            [start, end].iter().all(|d| d.is_finite() && d.length() > 0.0 && d.length().is_finite())
        }
        Ends::Closed | Ends::Free => true,
    };
    if !directions_fit || points.iter().any(|p| !p.is_finite()) {
        return Recognition::failed(Problem::NotFinite);
    }
    let mut rng = Rng::new(seed);
    let Some(chain) = prepared(points, matches!(ends, Ends::Closed)) else {
        return Recognition::failed(Problem::TooFewPoints);
    };
    // A turn of everything brings coordinates that are equal by design (straight and flat pieces) out of the degenerate
    // cases.
    let turn = rng.rotation();
    let chain: Vec<DVec3> = chain.into_iter().map(|p| turn * p).collect();
    match ends {
        Ends::Closed => recognize_closures(&[chain], &mut rng),
        Ends::Held { start, end } => {
            let closing = closing_path(&chain, turn * start.normalize(), turn * end.normalize());
            recognize_closures(&[[chain, closing].concat()], &mut rng)
        }
        Ends::Free => recognize_free(&chain, &mut rng),
    }
}

/// Neighbors at one place are made one point, and everything is brought to a cube of side two to four. The scale is a
/// power of two, which keeps the digits. `None` when nothing is left.
fn prepared(points: &[DVec3], closed: bool) -> Option<Vec<DVec3>> {
    let b = space::Aabb::around(points);
    let (middle, size) = (0.5 * b.min + 0.5 * b.max, (0.5 * b.max - 0.5 * b.min).max_element());
    if !(middle.is_finite() && size.is_finite() && size > 0.0) {
        return None;
    }
    let scale = libm::exp2(-libm::floor(libm::log2(size)));
    let mut chain: Vec<DVec3> = points.iter().map(|p| (*p - middle) * scale).collect();
    chain.dedup();
    if closed && chain.len() > 1 && chain.first() == chain.last() {
        chain.pop();
    }
    (chain.len() >= if closed { 3 } else { 2 } && chain.iter().all(|p| p.is_finite())).then_some(chain)
}

/// From the last point along its ray, round far outside, and back along the ray of the first point: the points between.
/// Any way round outside gives the same knot.
fn closing_path(chain: &[DVec3], start: DVec3, end: DVec3) -> Vec<DVec3> {
    const FAR: f64 = 16.0; // In radii of the ball that holds the chain.
    let (first, last) = (chain[0], chain[chain.len() - 1]);
    let between = start + end;
    let middle =
        if between.length() > 0.1 { between.normalize() } else { (start - end).normalize().any_orthonormal_vector() };
    vec![last + end * FAR, middle * (1.5 * FAR), first + start * FAR]
}

fn recognize_free(chain: &[DVec3], rng: &mut Rng) -> Recognition {
    let mut untrimmed: Option<Recognition> = None;
    for twentieths in 0..=5 {
        let trimmed = 0.05 * f64::from(twentieths);
        let piece = without_tails(chain, trimmed);
        if piece.len() < 2 {
            break;
        }
        let answer = Recognition { trimmed, ..recognize_closures(&random_closures(&piece, rng), rng) };
        let certain = answer.problem.is_none();
        match &untrimmed {
            None if certain => return answer,
            None => untrimmed = Some(answer),
            // The majority of the whole thread's closures, now certain.
            Some(whole)
                if certain
                    && whole.determinant == answer.determinant
                    && whole.signature == answer.signature
                    && whole.alexander == answer.alexander =>
            {
                return answer;
            }
            Some(_) => {}
        }
    }
    untrimmed.unwrap_or_else(|| Recognition::failed(Problem::TooFewPoints))
}

/// The chain without this part of its length at each end.
fn without_tails(chain: &[DVec3], part: f64) -> Vec<DVec3> {
    let length: f64 = chain.windows(2).map(|w| w[0].distance(w[1])).sum();
    let (from, to) = (part * length, (1.0 - part) * length);
    let mut piece = Vec::with_capacity(chain.len());
    let mut arc = 0.0;
    for w in chain.windows(2) {
        let l = w[0].distance(w[1]);
        let at = |s: f64| w[0].lerp(w[1], ((s - arc) / l).clamp(0.0, 1.0));
        if arc + l > from && arc < to {
            if piece.is_empty() {
                piece.push(at(from));
            }
            piece.push(at(to));
        }
        arc += l;
    }
    piece.dedup();
    piece
}

/// Closed polygons, each with its own pair of random rays. The chain is thinned once, with all the rays in its way.
fn random_closures(chain: &[DVec3], rng: &mut Rng) -> Vec<Vec<DVec3>> {
    let middle = chain.iter().sum::<DVec3>() / chain.len() as f64;
    let mut outward = |p: DVec3| {
        // A unit vector plus a random one is spread over the half space about it by the cosine.
        let d = (p - middle).try_normalize().unwrap_or(DVec3::X) + rng.direction();
        d.try_normalize().unwrap_or(DVec3::X)
    };
    let (first, last) = (chain[0], chain[chain.len() - 1]);
    let paths: Vec<Vec<DVec3>> = (0..CLOSURES).map(|_| closing_path(chain, outward(first), outward(last))).collect();
    let rays: Vec<[DVec3; 2]> = paths.iter().flat_map(|p| [[last, p[0]], [first, p[2]]]).collect();
    let mut thinned = chain.to_vec();
    reduce::reduce(&mut thinned, false, &rays);
    paths.into_iter().map(|p| [thinned.as_slice(), &p].concat()).collect()
}

/// The answer on which enough closures agree.
fn recognize_closures(closures: &[Vec<DVec3>], rng: &mut Rng) -> Recognition {
    let each: Vec<Recognition> = closures.iter().map(|polygon| recognize_closed(polygon.clone(), rng)).collect();
    let same = |a: &Recognition, b: &Recognition| {
        (a.knot, a.determinant, a.signature, &a.alexander, a.problem)
            == (b.knot, b.determinant, b.signature, &b.alexander, b.problem)
    };
    let agreed = |a: &Recognition| each.iter().filter(|b| same(a, b)).count();
    // Of equal counts the first wins, so that the answer does not depend on chance beyond the seed.
    let Some(best) = each.iter().rev().max_by_key(|a| agreed(a)) else {
        return Recognition::failed(Problem::TooFewPoints);
    };
    let mut answer = best.clone();
    answer.closures_agreed = agreed(best) as u32;
    answer.closures_total = closures.len() as u32;
    answer.projections_agreed = each.iter().filter(|b| same(best, b)).map(|b| b.projections_agreed).sum();
    answer.projections_total = each.iter().map(|b| b.projections_total).sum();
    if f64::from(answer.closures_agreed) < AGREEMENT * f64::from(answer.closures_total) {
        answer.knot = KnotType::Unknown;
        answer.problem = Some(Problem::Disagreement);
    }
    answer
}

/// A closed polygon, from several directions. All views must have the same invariants; the name is taken from the
/// simplest.
fn recognize_closed(mut polygon: Vec<DVec3>, rng: &mut Rng) -> Recognition {
    const MORE_VIEWS: u32 = 20;
    reduce::reduce(&mut polygon, true, &[]);
    if polygon.len() < 6 {
        // No knot has fewer than six sticks.
        return Recognition {
            projections_agreed: PROJECTIONS,
            projections_total: PROJECTIONS,
            ..Recognition::named(&[], &Invariants::unknot())
        };
    }
    let mut views: Vec<(Invariants, Vec<Part>)> = Vec::new();
    let mut problem = None;
    let mut failed = 0;
    while (views.len() as u32) < PROJECTIONS && failed < PROJECTIONS {
        match view(&polygon, rng).and_then(|v| identify(&v)) {
            Ok(v) => views.push(v),
            Err(p) => {
                // A view that cannot be read says nothing against the others; it is taken again, not for ever.
                problem = Some(p);
                failed += 1;
            }
        }
    }
    // What could have a name is worth looking at from more sides for a simpler view, which replaces one with the same
    // invariants.
    for _ in 0..MORE_VIEWS {
        if views.iter().any(|v| v.1.iter().all(|p| p.prime.is_some())) || !views.iter().any(|v| could_have_name(&v.0)) {
            break;
        }
        let Ok(better) = view(&polygon, rng).and_then(|v| identify(&v)) else { continue };
        if let Some(k) = views.iter().position(|v| v.0 == better.0 && crossings(&v.1) > crossings(&better.1)) {
            views[k] = better;
        }
    }
    let agreed = |v: &Invariants| views.iter().filter(|w| w.0 == *v).count();
    // The simplest of the views on which most agree; one with a name before one without.
    let best = views.iter().max_by_key(|(v, parts)| {
        (agreed(v), parts.iter().all(|p| p.prime.is_some()), core::cmp::Reverse(crossings(parts)))
    });
    let Some((invariants, parts)) = best else { return Recognition::failed(problem.unwrap_or(Problem::Degenerate)) };
    let mut answer = Recognition::named(parts, invariants);
    answer.projections_agreed = agreed(invariants) as u32;
    answer.projections_total = PROJECTIONS;
    if f64::from(answer.projections_agreed) < AGREEMENT * f64::from(PROJECTIONS) {
        answer.knot = KnotType::Unknown;
        answer.problem = Some(problem.unwrap_or(Problem::Disagreement));
    }
    answer
}

/// A connected summand as seen: its name when there is only one that fits, and the crossings left.
#[derive(Debug, Clone)]
struct Part {
    prime: Option<Prime>,
    crossings: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Prime {
    FigureEight,
    /// Number of crossings: 3, 5, 7 or 9.
    Torus(u8, Turn),
}

/// [`Hand`] with an order: right before left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Turn {
    Right,
    Left,
}

fn crossings(parts: &[Part]) -> usize {
    parts.iter().map(|p| p.crossings).sum()
}

/// The connected summands seen from a random direction, the simplest of a few.
fn view(polygon: &[DVec3], rng: &mut Rng) -> Result<Vec<Diagram>, Problem> {
    const DIRECTIONS: usize = 4;
    const ATTEMPTS: usize = 16;
    // Beyond these, before and after the first simplification, the rest would take long and hardly ever lead to a name.
    const MOST_SEEN: usize = 4000;
    const MOST_LAID: usize = 400;
    let mut turned = Vec::new();
    let mut simplest: Result<Diagram, Problem> = Err(Problem::Degenerate);
    let mut seen = 0;
    for _ in 0..ATTEMPTS {
        let turn = rng.rotation();
        turned.clear();
        turned.extend(polygon.iter().map(|p| turn * *p));
        match Diagram::project(&turned, MOST_SEEN) {
            Ok(mut diagram) => {
                diagram.simplify();
                if simplest.as_ref().map_or(true, |s| diagram.n_crossings() < s.n_crossings()) {
                    simplest = Ok(diagram);
                }
                seen += 1;
            }
            Err(Problem::Degenerate) => {}
            Err(problem) => return Err(problem),
        }
        if seen == DIRECTIONS {
            break;
        }
    }
    let simplest = simplest?;
    if simplest.n_crossings() > MOST_LAID { Err(Problem::TooTangled) } else { Ok(simplest.summands()) }
}

/// What the summands are, and the invariants of their sum.
fn identify(summands: &[Diagram]) -> Result<(Invariants, Vec<Part>), Problem> {
    let mut sum = Invariants::unknot();
    let mut parts = Vec::new();
    for summand in summands {
        let n = summand.n_crossings();
        let invariants = if n > MOST_CROSSINGS { None } else { summand.invariants() };
        let invariants = invariants.ok_or(Problem::TooTangled)?;
        sum = sum.sum(&invariants).ok_or(Problem::TooTangled)?;
        match primes_of(&invariants, n) {
            Some(primes) => {
                parts.extend(primes.into_iter().map(|prime| Part { prime: Some(prime), crossings: prime.crossings() }));
            }
            None => parts.push(Part { prime: None, crossings: n }),
        }
    }
    Ok((sum, parts))
}

/// The knot with these invariants, when among all knots of at most `n` crossings there is one. With up to nine
/// crossings no other knot, prime or not, has the determinant and signature of the torus knots below, nor the granny's
/// polynomial with its signature; up to seven none has the square knot's, which 8_20 shares; with up to ten crossings
/// only the unknot has polynomial 1.
fn primes_of(v: &Invariants, n: usize) -> Option<Vec<Prime>> {
    let turn = if v.signature < 0 { Turn::Right } else { Turn::Left };
    let alternating = |k: usize| {
        v.alexander.len() == k && v.alexander.iter().enumerate().all(|(i, c)| *c == if i % 2 == 0 { 1 } else { -1 })
    };
    match (v.alexander.as_slice(), v.signature.unsigned_abs()) {
        ([1], 0) if n <= 10 => Some(vec![]),
        ([1, -3, 1], 0) if n <= 9 => Some(vec![Prime::FigureEight]),
        ([1, -2, 3, -2, 1], 4) if n <= 9 => Some(vec![Prime::Torus(3, turn); 2]),
        ([1, -2, 3, -2, 1], 0) if n <= 7 => Some(vec![Prime::Torus(3, Turn::Right), Prime::Torus(3, Turn::Left)]),
        (_, s) if n <= 9 => [3_u8, 5, 7, 9]
            .into_iter()
            .find(|k| alternating((*k).into()) && s == u32::from(k - 1))
            .map(|k| vec![Prime::Torus(k, turn)]),
        _ => None,
    }
}

/// Whether some sum of the primes below has this polynomial and signature.
fn could_have_name(v: &Invariants) -> bool {
    could_be_sum(&v.alexander, i64::from(v.signature), 9)
}

/// The same with torus knots of at most `most` crossings, tried in falling order so that each sum is tried once.
fn could_be_sum(alexander: &[i64], signature: i64, most: u8) -> bool {
    if alexander == [1] {
        return signature == 0;
    }
    let figure_eight = || quotient(alexander, &[1, -3, 1]).is_some_and(|rest| could_be_sum(&rest, signature, 0));
    let torus = |n: u8| {
        let polynomial: Vec<i64> = (0..n).map(|i| if i % 2 == 0 { 1 } else { -1 }).collect();
        quotient(alexander, &polynomial).is_some_and(|rest| {
            [-1, 1].into_iter().any(|hand| could_be_sum(&rest, signature + hand * i64::from(n - 1), n))
        })
    };
    [9, 7, 5, 3].into_iter().any(|n| n <= most && torus(n)) || figure_eight()
}

/// Of two polynomials of which the second begins and ends with 1, when it goes without remainder.
fn quotient(a: &[i64], b: &[i64]) -> Option<Vec<i64>> {
    let n = (a.len() + 1).checked_sub(b.len())?;
    let (mut rest, mut result) = (a.to_vec(), vec![0; n]);
    for k in (0..n).rev() {
        result[k] = rest[k + b.len() - 1];
        for (r, c) in rest[k..].iter_mut().zip(b) {
            *r = r.checked_sub(result[k].checked_mul(*c)?)?;
        }
    }
    rest.iter().all(|r| *r == 0).then_some(result)
}

impl Prime {
    fn crossings(self) -> usize {
        match self {
            Prime::FigureEight => 4,
            Prime::Torus(n, _) => n.into(),
        }
    }
}

impl fmt::Display for Prime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Prime::FigureEight => write!(f, "4_1"),
            Prime::Torus(n, Turn::Right) => write!(f, "{n}_1"),
            Prime::Torus(n, Turn::Left) => write!(f, "m{n}_1"),
        }
    }
}

impl Recognition {
    /// Whether enough views and closures agree. The invariants are then those of the knot, whether or not it has a name
    /// here.
    pub fn is_certain(&self) -> bool {
        self.problem.is_none()
    }
    /// The name of the knot ([`KnotType::name`]). Without one it is `unnamed` where its invariants are certain and
    /// leave no knot that has a name here, and `unknown` where they are not.
    pub fn name(&self) -> &'static str {
        if self.knot == KnotType::Unknown && self.is_certain() { "unnamed" } else { self.knot.name() }
    }

    fn failed(problem: Problem) -> Self {
        Recognition {
            knot: KnotType::Unknown,
            determinant: 0,
            signature: 0,
            alexander: Vec::new(),
            crossings: 0,
            notation: "?".into(),
            projections_agreed: 0,
            projections_total: 0,
            closures_agreed: 0,
            closures_total: 0,
            trimmed: 0.0,
            problem: Some(problem),
        }
    }

    fn named(parts: &[Part], invariants: &Invariants) -> Self {
        let mut primes: Vec<Option<Prime>> = parts.iter().map(|p| p.prime).collect();
        // By name, parts without one last.
        primes.sort_by_key(|p| (p.is_none(), *p));
        let names: Vec<String> = primes.iter().map(|p| p.map_or_else(|| "?".into(), |p| p.to_string())).collect();
        Recognition {
            knot: primes
                .into_iter()
                .collect::<Option<Vec<_>>>()
                .map_or(KnotType::Unknown, |p| KnotType::from_primes(&p)),
            determinant: invariants.determinant,
            signature: invariants.signature,
            alexander: invariants.alexander.clone(),
            crossings: crossings(parts),
            notation: if names.is_empty() { "0_1".into() } else { names.join(" # ") },
            problem: None,
            ..Self::failed(Problem::Degenerate)
        }
    }
}

impl fmt::Display for Recognition {
    /// Such as `square knot (3_1 # m3_1), det 9, signature 0`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.knot == KnotType::Unknown && self.is_certain() {
            write!(f, "{}", self.name())?;
        } else {
            write!(f, "{}", self.knot)?;
        }
        if self.knot != KnotType::Unknown {
            write!(f, " ({})", self.notation)?;
        }
        if self.determinant > 0 {
            write!(f, ", det {}, signature {}", self.determinant, self.signature)?;
        }
        if let Some(problem) = self.problem {
            write!(f, "; {problem}")?;
        } else if self.knot == KnotType::Unknown {
            write!(f, ", {} crossings", self.crossings)?;
        }
        if self.closures_agreed < self.closures_total {
            write!(f, "; {} of {} closures agree", self.closures_agreed, self.closures_total)?;
        }
        Ok(())
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Problem::TooFewPoints => "too few points",
            Problem::NotFinite => "a coordinate or direction is not finite, or a direction is zero",
            Problem::Degenerate => "the thread meets itself",
            Problem::TooTangled => "too tangled to compute",
            Problem::Disagreement => "the ends can be closed in ways that give different knots",
        })
    }
}

impl KnotType {
    /// All names that [`KnotType::name`] gives.
    pub const NAMES: [&'static str; 24] = [
        "unknot",
        "trefoil-right",
        "trefoil-left",
        "figure-eight",
        "double-throw-right",
        "double-throw-left",
        "square",
        "granny-right",
        "granny-left",
        "surgeon-square-right",
        "surgeon-square-left",
        "surgeon-granny-right",
        "surgeon-granny-left",
        "square-and-throw-right",
        "square-and-throw-left",
        "three-equal-throws-right",
        "three-equal-throws-left",
        "surgeon-square-and-throw-right",
        "surgeon-square-and-throw-left",
        "triple-throw-right",
        "triple-throw-left",
        "quadruple-throw-right",
        "quadruple-throw-left",
        "further-throws",
    ];

    /// A stable name for files and tests, one of [`KnotType::NAMES`] or `unknown`.
    pub fn name(&self) -> &'static str {
        let of = |hand: &Hand, right, left| if *hand == Hand::Right { right } else { left };
        match self {
            KnotType::Unknot => "unknot",
            KnotType::Trefoil(h) => of(h, "trefoil-right", "trefoil-left"),
            KnotType::FigureEight => "figure-eight",
            KnotType::Cinquefoil(h) => of(h, "double-throw-right", "double-throw-left"),
            KnotType::Square => "square",
            KnotType::Granny(h) => of(h, "granny-right", "granny-left"),
            KnotType::SurgeonSquare(h) => of(h, "surgeon-square-right", "surgeon-square-left"),
            KnotType::SurgeonGranny(h) => of(h, "surgeon-granny-right", "surgeon-granny-left"),
            KnotType::SquareAndThrow(h) => of(h, "square-and-throw-right", "square-and-throw-left"),
            KnotType::ThreeEqualThrows(h) => of(h, "three-equal-throws-right", "three-equal-throws-left"),
            KnotType::SurgeonSquareAndThrow(h) => {
                of(h, "surgeon-square-and-throw-right", "surgeon-square-and-throw-left")
            }
            KnotType::TripleThrow(h) => of(h, "triple-throw-right", "triple-throw-left"),
            KnotType::QuadrupleThrow(h) => of(h, "quadruple-throw-right", "quadruple-throw-left"),
            KnotType::Throws(_) => "further-throws",
            KnotType::Unknown => "unknown",
        }
    }

    fn from_primes(primes: &[Prime]) -> Self {
        match primes {
            [] => return KnotType::Unknot,
            [Prime::FigureEight] => return KnotType::FigureEight,
            _ => {}
        }
        let mut throws = Throws::default();
        for prime in primes {
            let Prime::Torus(n, turn) = prime else { return KnotType::Unknown };
            let count = if *turn == Turn::Right { &mut throws.right } else { &mut throws.left };
            count[usize::from((n - 3) / 2)] += 1;
        }
        let seen_from = |own: [u8; 4], other: [u8; 4], hand: Hand| match (own, other) {
            ([1, 0, 0, 0], [0, 0, 0, 0]) => Some(KnotType::Trefoil(hand)),
            ([0, 1, 0, 0], [0, 0, 0, 0]) => Some(KnotType::Cinquefoil(hand)),
            ([0, 0, 1, 0], [0, 0, 0, 0]) => Some(KnotType::TripleThrow(hand)),
            ([0, 0, 0, 1], [0, 0, 0, 0]) => Some(KnotType::QuadrupleThrow(hand)),
            ([1, 0, 0, 0], [1, 0, 0, 0]) => Some(KnotType::Square),
            ([2, 0, 0, 0], [0, 0, 0, 0]) => Some(KnotType::Granny(hand)),
            ([0, 1, 0, 0], [1, 0, 0, 0]) => Some(KnotType::SurgeonSquare(hand)),
            ([1, 1, 0, 0], [0, 0, 0, 0]) => Some(KnotType::SurgeonGranny(hand)),
            ([2, 0, 0, 0], [1, 0, 0, 0]) => Some(KnotType::SquareAndThrow(hand)),
            ([3, 0, 0, 0], [0, 0, 0, 0]) => Some(KnotType::ThreeEqualThrows(hand)),
            ([1, 1, 0, 0], [1, 0, 0, 0]) => Some(KnotType::SurgeonSquareAndThrow(hand)),
            _ => None,
        };
        seen_from(throws.right, throws.left, Hand::Right)
            .or_else(|| seen_from(throws.left, throws.right, Hand::Left))
            .unwrap_or(KnotType::Throws(throws))
    }
}

impl fmt::Display for KnotType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (what, hand) = match self {
            KnotType::Unknot => ("unknot", None),
            KnotType::Trefoil(h) => ("trefoil", Some(h)),
            KnotType::FigureEight => ("figure-eight knot", None),
            KnotType::Cinquefoil(h) => ("double throw", Some(h)),
            KnotType::Square => ("square knot", None),
            KnotType::Granny(h) => ("granny knot", Some(h)),
            KnotType::SurgeonSquare(h) => ("surgeon's knot, square type", Some(h)),
            KnotType::SurgeonGranny(h) => ("surgeon's knot, granny type", Some(h)),
            KnotType::SquareAndThrow(h) => ("square knot and a throw", Some(h)),
            KnotType::ThreeEqualThrows(h) => ("three equal throws", Some(h)),
            KnotType::SurgeonSquareAndThrow(h) => ("surgeon's knot, square type, and a throw", Some(h)),
            KnotType::TripleThrow(h) => ("triple throw", Some(h)),
            KnotType::QuadrupleThrow(h) => ("quadruple throw", Some(h)),
            KnotType::Throws(_) => ("stack of throws", None),
            KnotType::Unknown => ("unknown", None),
        };
        match hand {
            Some(Hand::Right) => write!(f, "right {what}"),
            Some(Hand::Left) => write!(f, "left {what}"),
            None => write!(f, "{what}"),
        }
    }
}

/// Random numbers from a seed (SplitMix64, Steele, Lea and Flood 2014): views and closures need variety, not quality.
pub(super) struct Rng(u64);

impl Rng {
    pub(super) fn new(seed: u64) -> Self {
        Rng(seed)
    }
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
    /// In [0, 1).
    pub(super) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
    /// Evenly over the sphere.
    pub(super) fn direction(&mut self) -> DVec3 {
        let z = 2.0 * self.unit() - 1.0;
        let (s, c) = libm::sincos(core::f64::consts::TAU * self.unit());
        let r = (1.0 - z * z).max(0.0).sqrt();
        DVec3::new(r * c, r * s, z)
    }
    /// Evenly over all rotations (Shoemake 1992).
    fn rotation(&mut self) -> DQuat {
        let (u, a, b) = (self.unit(), core::f64::consts::TAU * self.unit(), core::f64::consts::TAU * self.unit());
        let ((sa, ca), (sb, cb)) = (libm::sincos(a), libm::sincos(b));
        let (p, q) = ((1.0 - u).sqrt(), u.sqrt());
        DQuat::from_xyzw(p * sa, p * ca, q * sb, q * cb).normalize()
    }
}
