//! Centerlines from pieces: lines, arcs, helices, points, and the cutting into elements of equal length.

use std::f64::consts::TAU;
use sutura::glam::{DQuat, DVec3};

/// One piece of a curve.
#[derive(Debug, Clone, PartialEq)]
pub enum Piece {
    Line {
        from: DVec3,
        to: DVec3,
    },
    /// From `start`, turned by `angle` about `axis` (unit) through `center`, advancing by `advance` along it.
    Turn {
        start: DVec3,
        center: DVec3,
        axis: DVec3,
        angle: f64,
        advance: f64,
    },
}

impl Piece {
    pub fn length(&self) -> f64 {
        match self {
            Piece::Line { from, to } => from.distance(*to),
            Piece::Turn { start, center, axis, angle, advance } => {
                let r = *start - *center;
                let across = (r - *axis * axis.dot(r)).length();
                (across * angle).hypot(*advance)
            }
        }
    }
    /// Point at the part `s` in \[0, 1\] of its length.
    pub fn at(&self, s: f64) -> DVec3 {
        match self {
            Piece::Line { from, to } => from.lerp(*to, s),
            Piece::Turn { start, center, axis, angle, advance } => {
                *center + DQuat::from_axis_angle(*axis, angle * s) * (*start - *center) + *axis * (advance * s)
            }
        }
    }
}

/// A curve of pieces, each beginning where the one before ended.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Curve {
    pieces: Vec<Piece>,
    /// Length up to the end of each piece.
    ends: Vec<f64>,
}

impl Curve {
    pub fn new(pieces: Vec<Piece>) -> Self {
        let mut sum = 0.0;
        let ends = pieces
            .iter()
            .map(|p| {
                sum += p.length();
                sum
            })
            .collect();
        Curve { pieces, ends }
    }
    pub fn through(points: &[DVec3]) -> Self {
        Self::new(points.windows(2).map(|p| Piece::Line { from: p[0], to: p[1] }).collect())
    }
    pub fn length(&self) -> f64 {
        self.ends.last().copied().unwrap_or(0.0)
    }
    /// Point at a length from the start; beyond the end it goes straight on.
    fn at(&self, s: f64) -> DVec3 {
        let i = self.ends.partition_point(|e| *e < s).min(self.pieces.len() - 1);
        let start = if i == 0 { 0.0 } else { self.ends[i - 1] };
        let length = self.ends[i] - start;
        if s > self.ends[i] {
            let (a, b) = (self.pieces[i].at(1.0 - 1e-6), self.pieces[i].at(1.0));
            return b + (b - a).normalize_or_zero() * (s - self.ends[i]);
        }
        self.pieces[i].at(if length > 0.0 { (s - start) / length } else { 0.0 })
    }

    /// `n + 1` points on the curve from its start to its end, neighbors at equal distance. Fails when the curve has no
    /// length.
    pub fn cut(&self, n: usize) -> Option<Vec<DVec3>> {
        let total = self.length();
        if self.pieces.is_empty() || n == 0 || !total.is_finite() || total <= 0.0 {
            return None;
        }
        // A single piece is uniform: equal parameters are equal chords.
        if let [piece] = self.pieces.as_slice() {
            return Some((0..=n).map(|i| piece.at(i as f64 / n as f64)).collect());
        }
        // The chord with which n steps end exactly at the end: steps that are too long overshoot. A chord is never
        // longer than its piece of curve, so total/n is an upper bound; the lower end is where even a straight way
        // would fall short.
        let (mut low, mut high) = (0.25 * total / n as f64, total / n as f64);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.march(n, middle, None) > total { high = middle } else { low = middle }
        }
        let mut points = Vec::with_capacity(n + 1);
        self.march(n, 0.5 * (low + high), Some(&mut points));
        // What the bisection leaves (1e-16 of the length) goes into the last point.
        if let Some(last) = points.last_mut() {
            *last = self.pieces[self.pieces.len() - 1].at(1.0);
        }
        Some(points)
    }

    /// Length reached by n steps of one chord; where points are not asked for, no farther than beyond the end.
    fn march(&self, n: usize, chord: f64, mut points: Option<&mut Vec<DVec3>>) -> f64 {
        let (mut s, mut x, total) = (0.0, self.at(0.0), self.length());
        if let Some(p) = points.as_deref_mut() {
            p.push(x);
        }
        for _ in 0..n {
            // The next point is at least a chord away along the curve; step on until the distance is bracketed.
            let (mut near, mut far) = (s, s + chord);
            while self.at(far).distance(x) < chord && far < s + 100.0 * chord {
                near = far;
                far += 0.1 * chord;
            }
            for _ in 0..60 {
                let middle = 0.5 * (near + far);
                if self.at(middle).distance(x) < chord { near = middle } else { far = middle }
            }
            s = 0.5 * (near + far);
            x = self.at(s);
            match points.as_deref_mut() {
                Some(p) => p.push(x),
                None if s > total => break,
                None => {}
            }
        }
        s
    }
}

/// A helix or arc about `axis` (unit) through `center`, from `start`, by `angle`, advancing by `advance` in all.
pub fn turn(start: DVec3, center: DVec3, axis: DVec3, angle: f64, advance: f64) -> Piece {
    Piece::Turn { start, center, axis, angle, advance }
}

/// The same by turns and pitch.
pub fn helix(start: DVec3, center: DVec3, axis: DVec3, turns: f64, pitch: f64) -> Piece {
    turn(start, center, axis, turns * TAU, pitch * turns.abs())
}

/// Points from text: three numbers a line, separated by commas, semicolons or blanks; the first line may be a heading,
/// lines beginning with `#` are remarks. Numbers are multiplied by `unit`.
pub fn read_points(text: &str, unit: f64) -> Result<Vec<DVec3>, String> {
    let mut points = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let numbers: Result<Vec<f64>, _> =
            line.split([',', ';', ' ', '\t']).filter(|w| !w.is_empty()).map(str::parse::<f64>).collect();
        match numbers.as_deref() {
            Ok([x, y, z]) if x.is_finite() && y.is_finite() && z.is_finite() => {
                points.push(DVec3::new(*x, *y, *z) * unit);
            }
            Ok(other) if other.len() != 3 => {
                return Err(format!("line {}: {} numbers, wanted three", i + 1, other.len()));
            }
            Err(_) if points.is_empty() && i == 0 => {}
            _ => {
                return Err(format!(
                    "line {}: `{}` is not three finite numbers",
                    i + 1,
                    line.chars().take(40).collect::<String>()
                ));
            }
        }
    }
    Ok(points)
}

/// Corners of a mesh and the corners of each triangle.
pub type Triangles = (Vec<DVec3>, Vec<[u32; 3]>);

/// Corners and triangles of a Wavefront OBJ text: `v` and `f` lines; polygons are cut into fans; all else is passed
/// over.
pub fn read_obj(text: &str, unit: f64) -> Result<Triangles, String> {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for (i, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        let wrong = |what: &str| Err(format!("line {}: {what}", i + 1));
        match words.next() {
            Some("v") => {
                let numbers: Vec<f64> =
                    words.take(3).filter_map(|w| w.parse().ok()).filter(|v: &f64| v.is_finite()).collect();
                let [x, y, z] = numbers.as_slice() else { return wrong("a corner is three finite numbers") };
                vertices.push(DVec3::new(*x, *y, *z) * unit);
            }
            Some("f") => {
                let mut corners = Vec::new();
                for word in words {
                    let first = word.split('/').next().unwrap_or_default();
                    let index = match first.parse::<i64>() {
                        Ok(n) if n > 0 => Some(n - 1),
                        Ok(n) if n < 0 => Some(vertices.len() as i64 + n),
                        _ => None,
                    };
                    let Some(index) =
                        index.and_then(|n| u32::try_from(n).ok()).filter(|n| (*n as usize) < vertices.len())
                    else {
                        return wrong(&format!("`{word}` does not name a corner before it"));
                    };
                    corners.push(index);
                }
                if corners.len() < 3 {
                    return wrong("a face has at least three corners");
                }
                triangles.extend((1..corners.len() - 1).map(|k| [corners[0], corners[k], corners[k + 1]]));
            }
            _ => {}
        }
    }
    Ok((vertices, triangles))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_around_a_post_is_cut_into_equal_chords_that_end_at_its_end() {
        let axis = DVec3::Z;
        let arc_start = DVec3::new(0.0, -0.005, 0.0);
        let pieces = vec![
            Piece::Line { from: DVec3::new(-0.04, -0.005, 0.0), to: arc_start },
            turn(arc_start, DVec3::ZERO, axis, std::f64::consts::PI, 0.001),
            Piece::Line { from: DVec3::new(0.0, 0.005, 0.001), to: DVec3::new(-0.03, 0.005, 0.001) },
        ];
        let curve = Curve::new(pieces);
        let n = 200;
        let points = curve.cut(n).unwrap();
        assert_eq!(points.len(), n + 1);
        let chord = points[0].distance(points[1]);
        for p in points.windows(2) {
            // Bisection ends at the rounding of positions of a few centimeters.
            assert!((p[0].distance(p[1]) - chord).abs() < 1e-14, "{}", p[0].distance(p[1]) - chord);
        }
        assert!(points[n].distance(DVec3::new(-0.03, 0.005, 0.001)) < 1e-15);
        // A chord is shorter than its arc by (l/R)^2/24, of which a sixth of the length is bent.
        assert!(chord < curve.length() / n as f64 && chord > 0.999 * curve.length() / n as f64);
    }

    #[test]
    fn a_helix_has_its_radius_pitch_and_hand() {
        let piece = helix(DVec3::X * 0.005, DVec3::ZERO, DVec3::Z, 3.0, 0.002);
        let points = Curve::new(vec![piece.clone()]).cut(90).unwrap();
        assert!((points[90] - DVec3::new(0.005, 0.0, 0.006)).length() < 1e-15);
        assert!(points[1].y > 0.0 && points[1].z > 0.0, "right-handed");
        assert!((piece.length() - 3.0 * (TAU * 0.005).hypot(0.002)).abs() < 1e-15);
    }

    #[test]
    fn a_polyline_is_cut_across_its_corners() {
        let curve = Curve::through(&[DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0)]);
        let points = curve.cut(7).unwrap();
        let chord = points[0].distance(points[1]);
        assert!(points.windows(2).all(|p| (p[0].distance(p[1]) - chord).abs() < 1e-12));
    }

    #[test]
    fn nothing_is_cut_from_nothing() {
        assert_eq!(Curve::default().cut(3), None);
        assert_eq!(Curve::through(&[DVec3::ONE, DVec3::ONE]).cut(3), None);
    }

    #[test]
    fn points_and_meshes_are_read_or_refused_with_the_line() {
        assert_eq!(read_points("x,y,z\n1,2,3\n# end\n4 5 6\n", 1e-3).unwrap()[1], DVec3::new(4.0, 5.0, 6.0) * 1e-3);
        assert!(read_points("1,2,3\n1,2\n", 1.0).unwrap_err().contains("line 2"));
        assert!(read_points("1,2,3\n1,2,nan\n", 1.0).unwrap_err().contains("line 2"));
        let (v, t) = read_obj("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nf 1/1 2/2 3 -1\n", 2.0).unwrap();
        assert_eq!((v.len(), v[1].x, t), (4, 2.0, vec![[0, 1, 2], [0, 2, 3]]));
        assert!(read_obj("v 0 0 0\nf 1 2 3\n", 1.0).unwrap_err().contains("line 2"));
    }
}
