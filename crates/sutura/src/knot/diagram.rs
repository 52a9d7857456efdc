//! Knot diagrams: projection of a polygon, Reidemeister moves I and II, connected summands, and the invariants of each:
//! determinant and signature from a Goeritz matrix (Gordon and Litherland 1978), Alexander polynomial from the
//! Wirtinger relations. All of it is integer arithmetic. A positive crossing is right-handed; a right-handed trefoil
//! has signature -2.

use super::Problem;
use glam::DVec3;
use robust::{Coord, Coord3D, orient2d, orient3d};

/// One passage through a crossing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Pass {
    crossing: u32,
    over: bool,
}

/// A signed Gauss code: the passages in order along the knot. Every crossing is in it twice.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Diagram {
    code: Vec<Pass>,
    /// Sign of each crossing, +1 is right-handed; crossings that were removed keep their entry.
    signs: Vec<i8>,
}

/// What is known of a knot from a diagram.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Invariants {
    pub determinant: u64,
    pub signature: i32,
    /// Alexander polynomial, constant coefficient first, its end coefficients not zero, the last positive.
    pub alexander: Vec<i64>,
}

impl Invariants {
    pub fn unknot() -> Self {
        Invariants { determinant: 1, signature: 0, alexander: vec![1] }
    }
    /// Of the connected sum; `None` when a number does not fit.
    pub fn sum(&self, other: &Invariants) -> Option<Self> {
        let mut alexander = vec![0_i64; self.alexander.len() + other.alexander.len() - 1];
        for (i, a) in self.alexander.iter().enumerate() {
            for (j, b) in other.alexander.iter().enumerate() {
                alexander[i + j] = alexander[i + j].checked_add(a.checked_mul(*b)?)?;
            }
        }
        Some(Invariants {
            determinant: self.determinant.checked_mul(other.determinant)?,
            signature: self.signature + other.signature,
            alexander,
        })
    }
}

/// Sign of the volume of `abcd`: that of `(b - a) x (d - c) . (c - a)`.
fn side(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> i8 {
    let coord = |p: DVec3| Coord3D { x: p.x, y: p.y, z: p.z };
    let volume = orient3d(coord(a), coord(b), coord(c), coord(d));
    i8::from(volume > 0.0) - i8::from(volume < 0.0)
}

impl Diagram {
    /// The view of a closed polygon along z. `Degenerate` when it is not in general position (a corner on an edge,
    /// three strands in a point): another direction must be tried. `TooTangled` with more than `most` crossings.
    pub fn project(points: &[DVec3], most: usize) -> Result<Self, Problem> {
        // Nearer than this to each other or to a corner, in parameter of the edge, the order along the strand is in
        // doubt.
        const TIE: f64 = 1e-9;
        let n = points.len();
        let coord = |p: DVec3| Coord { x: p.x, y: p.y };
        let mut passes = Vec::new(); // (edge, parameter, passage)
        let mut signs = Vec::new();
        for i in 0..n {
            let (p, q) = (points[i], points[(i + 1) % n]);
            let (low, high) = (p.min(q), p.max(q));
            // The last edge is next to the first.
            let last = if i == 0 { n.saturating_sub(1) } else { n };
            for j in i + 2..last {
                let (r, s) = (points[j], points[(j + 1) % n]);
                let (l, h) = (r.min(s), r.max(s));
                if l.x > high.x || h.x < low.x || l.y > high.y || h.y < low.y {
                    continue;
                }
                let (at_p, at_q) = (orient2d(coord(r), coord(s), coord(p)), orient2d(coord(r), coord(s), coord(q)));
                let (at_r, at_s) = (orient2d(coord(p), coord(q), coord(r)), orient2d(coord(p), coord(q), coord(s)));
                if at_p * at_q > 0.0 || at_r * at_s > 0.0 {
                    continue;
                }
                let (u, v) = (at_p / (at_p - at_q), at_r / (at_r - at_s));
                let inside = |t: f64| t > TIE && t < 1.0 - TIE;
                let volume = side(p, q, r, s);
                if !inside(u) || !inside(v) || volume == 0 {
                    return Err(Problem::Degenerate);
                }
                if signs.len() == most {
                    return Err(Problem::TooTangled);
                }
                // With V = (q - p) x (s - r) . (r - p) and d = ((q - p) x (s - r)).z, rs is above pq by V / d.
                let d = if at_s > at_r { 1 } else { -1 };
                let crossing = signs.len() as u32;
                let over = volume * d < 0;
                passes.push((i, u, Pass { crossing, over }));
                passes.push((j, v, Pass { crossing, over: !over }));
                signs.push(-volume);
            }
        }
        passes.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        if passes.windows(2).any(|w| w[0].0 == w[1].0 && w[1].1 - w[0].1 < TIE) {
            return Err(Problem::Degenerate);
        }
        Ok(Diagram { code: passes.into_iter().map(|p| p.2).collect(), signs })
    }

    pub fn n_crossings(&self) -> usize {
        self.code.len() / 2
    }

    /// Place of the other passage of each passage.
    fn partners(&self) -> Vec<usize> {
        let mut first = vec![usize::MAX; self.signs.len()];
        let mut partner = vec![0; self.code.len()];
        for (k, pass) in self.code.iter().enumerate() {
            let c = pass.crossing as usize;
            if first[c] == usize::MAX {
                first[c] = k;
            } else {
                partner[k] = first[c];
                partner[first[c]] = k;
            }
        }
        partner
    }

    /// Takes out kinks (Reidemeister I) and pairs of crossings by which one strand lies over another without being held
    /// (Reidemeister II) until there are none. Two crossings that follow each other on both strands always bound an
    /// empty cell: the rest of the knot cannot be on both sides of it.
    pub fn simplify(&mut self) {
        loop {
            let (n, partner) = (self.code.len(), self.partners());
            let after = |k: usize| if k + 1 == n { 0 } else { k + 1 };
            let mut gone = vec![false; n];
            let mut any = false;
            for k in 0..n {
                let (l, a, b) = (after(k), partner[k], partner[after(k)]);
                if gone[k] || gone[l] {
                    continue;
                }
                let kink = a == l;
                let pair = !kink && self.code[k].over == self.code[l].over && (after(a) == b || after(b) == a);
                if kink || pair {
                    for m in [k, l, a, b] {
                        gone[m] = true;
                    }
                    any = true;
                }
            }
            if !any {
                return;
            }
            let mut keep = gone.iter();
            self.code.retain(|_| !keep.next().is_some_and(|g| *g));
        }
    }

    /// Simplifies as far as it goes without ever adding crossings, and cuts the diagram into connected summands where a
    /// stretch of the strand closes on itself: each of its crossings has both passages in it. Parts without crossings
    /// are dropped.
    pub fn summands(mut self) -> Vec<Diagram> {
        let mut done = Vec::new();
        loop {
            self.simplify();
            while !self.code.is_empty() && self.lay_strand_shorter() {
                self.simplify();
            }
            let Some((start, len)) = self.shortest_summand() else { break };
            self.code.rotate_left(start);
            let rest = self.code.split_off(len);
            let part = Diagram { code: core::mem::replace(&mut self.code, rest), signs: self.signs.clone() };
            // No shorter stretch closes, so the part has no summand of its own, but closing it up may have made a kink
            // or pair.
            done.extend(part.summands());
        }
        if !self.code.is_empty() {
            done.push(self);
        }
        done
    }

    fn shortest_summand(&self) -> Option<(usize, usize)> {
        let (n, partner) = (self.code.len(), self.partners());
        let mut best: Option<(usize, usize)> = None;
        for start in 0..n {
            let limit = best.map_or(n / 2, |b| b.1 - 1);
            let (mut open, mut len) = (0_usize, 0);
            while len < limit {
                let k = (start + len) % n;
                // How far along the stretch the partner is tells whether it was passed already.
                let closes = (partner[k] + n - start) % n < len;
                open = if closes { open - 1 } else { open + 1 };
                len += 1;
                if open == 0 {
                    best = Some((start, len));
                    break;
                }
            }
        }
        best
    }

    /// Crossings numbered 0, 1, ... with their sign and the places of their under and over passage.
    fn crossings(&self) -> Vec<(i8, usize, usize)> {
        let mut number = vec![usize::MAX; self.signs.len()];
        let mut out: Vec<(i8, usize, usize)> = Vec::with_capacity(self.n_crossings());
        for (k, pass) in self.code.iter().enumerate() {
            let c = pass.crossing as usize;
            if number[c] == usize::MAX {
                number[c] = out.len();
                out.push((self.signs[c], k, k));
            }
            let place = &mut out[number[c]];
            if pass.over {
                place.2 = k;
            } else {
                place.1 = k;
            }
        }
        out
    }

    /// Determinant, signature and Alexander polynomial. Three ways must agree (both colorings of the regions, and the
    /// polynomial at -1); `None` when they do not, when the code does not lie in a plane, or when a number does not
    /// fit.
    pub fn invariants(&self) -> Option<Invariants> {
        if self.code.is_empty() {
            return Some(Invariants::unknot());
        }
        let crossings = self.crossings();
        let (determinant, signature) = self.goeritz(&crossings)?;
        let alexander = self.alexander(&crossings)?;
        let at_minus_one = alexander.iter().rev().try_fold(0_i64, |v, c| c.checked_sub(v))?.unsigned_abs();
        let at_one = alexander.iter().sum::<i64>().abs();
        (at_minus_one == determinant && at_one == 1).then_some(Invariants { determinant, signature, alexander })
    }

    /// The regions of the plane. Edge k leaves passage k; it has a left side 2 k and a right side 2 k + 1, and sides
    /// that meet at a corner are one region. Also a side at each corner of each crossing; corner k lies between its
    /// strands k and k + 1, counted counterclockwise from the incoming lower one.
    fn regions(&self, crossings: &[(i8, usize, usize)]) -> (Regions, Vec<[usize; 4]>) {
        let n_edges = self.code.len();
        let mut region = Regions((0..2 * n_edges).collect());
        let into = |place: usize| (place + n_edges - 1) % n_edges;
        let mut corners = Vec::with_capacity(crossings.len());
        for &(sign, under, over) in crossings {
            // (edge, whether it leaves the crossing)
            let (over_in, over_out) = ((into(over), false), (over, true));
            let strands = if sign > 0 {
                [(into(under), false), over_out, (under, true), over_in]
            } else {
                [(into(under), false), over_in, (under, true), over_out]
            };
            let mut corner = [0; 4];
            for k in 0..4 {
                let ((e, leaves), (f, next_leaves)) = (strands[k], strands[(k + 1) % 4]);
                let counterclockwise_of = 2 * e + usize::from(!leaves);
                let clockwise_of = 2 * f + usize::from(next_leaves);
                region.unite(counterclockwise_of, clockwise_of);
                corner[k] = counterclockwise_of;
            }
            corners.push(corner);
        }
        (region, corners)
    }

    /// Lays a strand that goes over (or under) everything it meets somewhere else, where it meets less: between its
    /// ends any way over all else is as good. Whether there was such a strand.
    fn lay_strand_shorter(&mut self) -> bool {
        let n = self.code.len();
        let (base, _) = self.regions(&self.crossings());
        for start in 0..n {
            let over = self.code[start].over;
            let before = (start + n - 1) % n;
            if self.code[before].over == over {
                continue;
            }
            let len = (1..n).find(|l| self.code[(start + l) % n].over != over).unwrap_or(n);
            // Without the strand the regions on its two sides are one.
            let mut region = Regions(base.0.clone());
            let mut on_strand = vec![false; n];
            for k in 0..=len {
                let edge = (before + k) % n;
                on_strand[edge] = true;
                region.unite(2 * edge, 2 * edge + 1);
            }
            let (from, to) = (region.find(2 * before), region.find(2 * ((before + len) % n)));
            if let Some(path) = region.shortest_path(&on_strand, from, to, len - 1) {
                self.replace_strand(start, len, &path);
                return true;
            }
        }
        false
    }

    /// Takes out the strand of `len` passages from `start` on and leads it across the edges of `path`; true is from
    /// their left side.
    fn replace_strand(&mut self, start: usize, len: usize, path: &[(usize, bool)]) {
        let (n, partner) = (self.code.len(), self.partners());
        let over = self.code[start].over;
        let mut gone = vec![false; n];
        for k in (0..len).map(|k| (start + k) % n) {
            gone[k] = true;
            gone[partner[k]] = true;
        }
        let first_new = self.signs.len();
        // From left to right over the edge is right-handed.
        self.signs.extend(path.iter().map(|(_, from_left)| if *from_left == over { 1 } else { -1 }));
        let mut across: Vec<Option<usize>> = vec![None; n];
        for (k, (edge, _)) in path.iter().enumerate() {
            across[*edge] = Some(first_new + k);
        }
        let mut code = Vec::with_capacity(n);
        for k in 0..n {
            if !gone[k] {
                code.push(self.code[k]);
            }
            if let Some(c) = across[k] {
                code.push(Pass { crossing: c as u32, over: !over });
            }
            if (k + 1) % n == start {
                code.extend((0..path.len()).map(|k| Pass { crossing: (first_new + k) as u32, over }));
            }
        }
        self.code = code;
    }

    fn goeritz(&self, crossings: &[(i8, usize, usize)]) -> Option<(u64, i32)> {
        let n_edges = self.code.len();
        let (mut region, corners) = self.regions(crossings);
        let roots: Vec<usize> = (0..2 * n_edges).map(|k| region.find(k)).collect();
        let n_regions = roots.iter().enumerate().filter(|(k, r)| *k == **r).count();
        if n_regions != crossings.len() + 2 {
            return None;
        }
        // Checkerboard: the two sides of an edge differ. Along the strand from one edge to the next the sides swap
        // color.
        let mut color = vec![None; 2 * n_edges];
        for k in 0..n_edges {
            for (side, c) in [(2 * k, k % 2 == 0), (2 * k + 1, k % 2 == 1)] {
                if *color[roots[side]].get_or_insert(c) != c {
                    return None;
                }
            }
        }
        let of_color = |shade: bool| -> Option<(u64, i32)> {
            let mut index = vec![usize::MAX; 2 * n_edges];
            let mut n = 0;
            for k in 0..2 * n_edges {
                if roots[k] == k && color[k] == Some(shade) {
                    index[k] = n;
                    n += 1;
                }
            }
            let mut g = vec![vec![0_i128; n]; n];
            let mut correction = 0;
            for (corner, &(sign, ..)) in corners.iter().zip(crossings) {
                let first = if color[roots[corner[0]]] == Some(shade) { 0 } else { 1 };
                let eta = if first == 1 { 1 } else { -1 };
                let (a, b) = (index[roots[corner[first]]], index[roots[corner[first + 2]]]);
                if a != b {
                    g[a][b] -= eta;
                    g[b][a] -= eta;
                    g[a][a] += eta;
                    g[b][b] += eta;
                }
                let second_type = if sign > 0 { first == 0 } else { first == 1 };
                correction += if second_type { eta as i32 } else { 0 };
            }
            g.pop();
            for row in &mut g {
                row.pop();
            }
            let (determinant, signature) = signature_of(g)?;
            Some((determinant, correction - signature))
        };
        let (black, white) = (of_color(true)?, of_color(false)?);
        (black == white).then_some(black)
    }

    fn alexander(&self, crossings: &[(i8, usize, usize)]) -> Option<Vec<i64>> {
        let n = crossings.len();
        // Arc on which each passage lies; a lower passage ends one arc and begins the next.
        let first_under = crossings[0].1;
        let mut arc = vec![0; self.code.len()];
        let mut current = 0;
        for step in 1..=self.code.len() {
            let k = (first_under + step) % self.code.len();
            arc[k] = current;
            current += usize::from(!self.code[k].over);
        }
        let values: Vec<u64> = (0..n as u64)
            .map(|t| {
                let mut m = vec![vec![0; n]; n];
                for (row, &(sign, under, over)) in m.iter_mut().zip(crossings) {
                    let (into, out) = (arc[under], (arc[under] + 1) % n);
                    let (with_t, minus_one) = if sign > 0 { (into, out) } else { (out, into) };
                    row[arc[over]] = modular::add(row[arc[over]], modular::sub(1, t));
                    row[with_t] = modular::add(row[with_t], t);
                    row[minus_one] = modular::sub(row[minus_one], 1);
                }
                m.pop();
                for row in &mut m {
                    row.pop();
                }
                modular::determinant(m)
            })
            .collect();
        let mut coefficients: Vec<i64> = modular::interpolate(&values).into_iter().map(modular::lift).collect();
        while coefficients.last() == Some(&0) {
            coefficients.pop();
        }
        let zeros = coefficients.iter().take_while(|c| **c == 0).count();
        coefficients.drain(..zeros);
        if *coefficients.last()? < 0 {
            coefficients.iter_mut().for_each(|c| *c = -*c);
        }
        Some(coefficients)
    }
}

/// Sides of edges joined to regions (union-find).
struct Regions(Vec<usize>);

impl Regions {
    fn find(&mut self, mut k: usize) -> usize {
        while self.0[k] != k {
            self.0[k] = self.0[self.0[k]];
            k = self.0[k];
        }
        k
    }
    fn unite(&mut self, a: usize, b: usize) {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a] = b;
    }
    /// Edges to cross on the shortest way from one region to another, at most `longest`, none of those that are
    /// `closed`; true where it is crossed from its left side.
    fn shortest_path(&mut self, closed: &[bool], from: usize, to: usize, longest: usize) -> Option<Vec<(usize, bool)>> {
        // (region before, edge, from left)
        let mut came: Vec<Option<(usize, usize, bool)>> = vec![None; self.0.len()];
        let mut front = vec![from];
        for _ in 0..longest {
            if came[to].is_some() || from == to {
                break;
            }
            let mut next = Vec::new();
            for edge in (0..closed.len()).filter(|e| !closed[*e]) {
                let (left, right) = (self.find(2 * edge), self.find(2 * edge + 1));
                for (a, b, from_left) in [(left, right, true), (right, left, false)] {
                    if front.contains(&a) && b != from && came[b].is_none() {
                        came[b] = Some((a, edge, from_left));
                        next.push(b);
                    }
                }
            }
            front = next;
        }
        let mut path = Vec::new();
        let mut at = to;
        while at != from {
            let (before, edge, from_left) = came[at]?;
            path.push((edge, from_left));
            at = before;
        }
        path.reverse();
        Some(path)
    }
}

/// |determinant| and signature of a symmetric integer matrix that is not singular, by elimination without fractions (Bareiss 1968):
/// the pivots are the leading minors, and the sign of each over the one before is a sign of the diagonal form.
fn signature_of(mut g: Vec<Vec<i128>>) -> Option<(u64, i32)> {
    let n = g.len();
    let mut last = 1_i128;
    let mut signature = 0;
    for k in 0..n {
        if g[k][k] == 0 {
            // Another pivot to the front, or, where the diagonal is all zero, the sum of two rows and columns.
            if let Some(j) = (k + 1..n).find(|j| g[*j][*j] != 0) {
                g.swap(k, j);
                g.iter_mut().for_each(|row| row.swap(k, j));
            } else {
                let (i, j) = (k..n).flat_map(|i| (i + 1..n).map(move |j| (i, j))).find(|(i, j)| g[*i][*j] != 0)?;
                g.swap(k, i);
                g.iter_mut().for_each(|row| row.swap(k, i));
                let (upper, lower) = g.split_at_mut(j);
                for (a, b) in upper[k].iter_mut().zip(&lower[0]).skip(k) {
                    *a += b;
                }
                for row in g.iter_mut().skip(k) {
                    row[k] += row[j];
                }
            }
        }
        let pivot = g[k][k];
        if pivot == 0 {
            return None;
        }
        signature += if (pivot > 0) == (last > 0) { 1 } else { -1 };
        for i in k + 1..n {
            for j in k + 1..n {
                g[i][j] = (g[i][j].checked_mul(pivot)?.checked_sub(g[i][k].checked_mul(g[k][j])?)?) / last;
            }
        }
        last = pivot;
    }
    Some((u64::try_from(last.unsigned_abs()).ok()?, signature))
}

/// Arithmetic modulo the prime 2^61 - 1. Coefficients of the diagrams dealt with are far below it.
mod modular {
    const P: u64 = (1 << 61) - 1;

    pub fn add(a: u64, b: u64) -> u64 {
        (a + b) % P
    }
    pub fn sub(a: u64, b: u64) -> u64 {
        (a + P - b) % P
    }
    fn mul(a: u64, b: u64) -> u64 {
        let product = u128::from(a) * u128::from(b);
        let folded = (product as u64 & P) + (product >> 61) as u64;
        if folded >= P { folded - P } else { folded }
    }
    fn inverse(a: u64) -> u64 {
        let (mut base, mut exponent, mut result) = (a, P - 2, 1);
        while exponent > 0 {
            if exponent & 1 == 1 {
                result = mul(result, base);
            }
            base = mul(base, base);
            exponent >>= 1;
        }
        result
    }
    /// The representative nearest to zero.
    pub fn lift(a: u64) -> i64 {
        if a > P / 2 { a as i64 - P as i64 } else { a as i64 }
    }
    pub fn determinant(mut m: Vec<Vec<u64>>) -> u64 {
        let n = m.len();
        let mut result = 1;
        for k in 0..n {
            let Some(pivot_row) = (k..n).find(|i| m[*i][k] != 0) else { return 0 };
            if pivot_row != k {
                m.swap(k, pivot_row);
                result = sub(0, result);
            }
            result = mul(result, m[k][k]);
            let (upper, lower) = m.split_at_mut(k + 1);
            let (pivot, scale) = (&upper[k], inverse(upper[k][k]));
            for row in lower.iter_mut().filter(|row| row[k] != 0) {
                let factor = mul(row[k], scale);
                for j in k..n {
                    row[j] = sub(row[j], mul(factor, pivot[j]));
                }
            }
        }
        result
    }
    /// Coefficients of the polynomial with the given values at 0, 1, 2, ... (Newton's divided differences).
    pub fn interpolate(values: &[u64]) -> Vec<u64> {
        let n = values.len();
        let mut d = values.to_vec();
        for order in 1..n {
            let scale = inverse(order as u64);
            for i in (order..n).rev() {
                d[i] = mul(sub(d[i], d[i - 1]), scale);
            }
        }
        let mut polynomial = vec![0; n];
        for k in (0..n).rev() {
            // polynomial <- polynomial (t - k) + d_k
            for i in (0..n).rev() {
                let shifted = if i > 0 { polynomial[i - 1] } else { 0 };
                polynomial[i] = sub(shifted, mul(polynomial[i], k as u64));
            }
            polynomial[0] = add(polynomial[0], d[k]);
        }
        polynomial
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolation_gives_back_the_polynomial() {
        // 2 - 3 t + t^3 at 0..5.
        let values: Vec<u64> = (0..5_i64).map(|t| (2 - 3 * t + t * t * t) as u64).collect();
        let lifted: Vec<i64> = modular::interpolate(&values).into_iter().map(modular::lift).collect();
        assert_eq!(lifted, [2, -3, 0, 1, 0]);
    }

    #[test]
    fn the_side_has_the_sign_of_the_triple_product() {
        // (b - a) x (d - c) . (c - a) for a = 0, b = x, c = z, d = z + y is x x y . z = 1.
        assert_eq!(side(DVec3::ZERO, DVec3::X, DVec3::Z, DVec3::Z + DVec3::Y), 1);
    }

    #[test]
    fn signature_needs_no_diagonal() {
        // A hyperbolic plane beside a negative line.
        let g = vec![vec![0, 1, 0], vec![1, 0, 0], vec![0, 0, -2]];
        assert_eq!(signature_of(g), Some((2, -1)));
        assert_eq!(signature_of(vec![vec![0, 3], vec![3, 0]]), Some((9, 0)));
        assert_eq!(signature_of(vec![vec![1, 1], vec![1, 1]]), None);
    }

    #[test]
    fn a_kink_and_a_strand_lying_over_another_go_away() {
        let pass = |crossing, over| Pass { crossing, over };
        // Crossings 0 and 1: one strand twice over the other. Crossing 2: a kink between.
        let code = vec![pass(0, true), pass(2, true), pass(2, false), pass(1, true), pass(1, false), pass(0, false)];
        let mut d = Diagram { code, signs: vec![1, -1, 1] };
        d.simplify();
        assert_eq!(d.n_crossings(), 0);
    }
}
