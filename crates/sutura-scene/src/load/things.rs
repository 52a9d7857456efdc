//! Threads and shapes.

use super::*;
use crate::scene::{AnchorDef, Remake};

/// Most elements of all threads together: far beyond what runs in real time, and a slip of the pen must not fill the
/// memory or cut a centerline for minutes.
const MAX_ELEMENTS: usize = 50_000;

impl<'d> Loader<'d> {
    pub(super) fn thread(&mut self, table: &Table<'d>) {
        let index = self.threads.len();
        let name = table
            .need("name", "the name of the thread")
            .and_then(|v| v.text())
            .map_or(format!("thread{index}"), std::borrow::Cow::into_owned);
        let shape = self.cross_section(table);
        let material = self.material(table);
        let stretch = stretch(table);
        let surface = self.surface(table, 0);
        let knot = table.truth_or("knot", false);
        let strength = strength(table);
        let points = self.centerline(table, None);
        let hint = table.vector("d1", Dim::NUMBER);
        let twist = table.quantity_or("twist", Dim::ANGLE, 0.0);
        let (roll, pretwist) =
            (table.quantity_or("roll", Dim::ANGLE, 0.0), table.quantity_or("pretwist", Dim::ANGLE, 0.0));
        let closed = table.truth_or("closed", false);
        if closed && let Some(v) = table.get("d1") {
            v.problem("a closed thread turns its section by `roll`", None);
        }
        let rest_value = table.get("rest");
        let (Some(points), Some((section, radius, size)), Some((material, modulus, density))) =
            (points, shape, material)
        else {
            // What is missing was reported; a stand-in keeps the numbers of the following threads right.
            if let Some(rest) = rest_value {
                let _ = self.rest(&rest, 1, closed);
            }
            let spec = RodSpec::straight(DVec3::ZERO, DVec3::X, 1, 1e-3, Material::elastic(1e9, 1e3));
            self.threads.push(ThreadDef { name, spec, location: table.location(), knot, strength });
            return;
        };
        let mut spec = RodSpec {
            section,
            roll,
            pretwist,
            along: Along { size, modulus, density },
            ..RodSpec::new(points, radius, material)
        };
        spec.stretch = stretch.unwrap_or(Stretch::Elastic);
        spec.surface = surface;
        if closed {
            // A centerline that comes back to its start names that point twice.
            let points = &mut spec.centerline;
            let n = points.len();
            if n > 3 && points[n - 1].distance(points[0]) < 0.5 * points[1].distance(points[0]) {
                points.pop();
            }
            spec.closure = Some(Closure { twist });
        }
        if let Some(rest) = rest_value {
            spec.rest = self.rest(&rest, n_elements(&spec), closed).unwrap_or(RestShape::Straight);
        }
        if !closed && (hint.is_some() || twist != 0.0) {
            spec.frames = frames(&spec.centerline, hint, twist);
        }
        self.threads.push(ThreadDef { name, spec, location: table.location(), knot, strength });
    }

    /// Section, radius with which it touches, and the size of the section along the thread over its largest.
    pub(super) fn cross_section(&self, table: &Table<'d>) -> Option<(Section, f64, Profile)> {
        let section = table.get("section").map(|v| section(&v));
        let preset = table.get("size").and_then(|v| match presets::find_size(&v.text()?) {
            Ok(size) => Some(0.5 * size.diameter.value),
            Err(e) => {
                v.problem(e.to_string(), None);
                None
            }
        });
        let radius = along(table, "radius", Dim::LENGTH);
        let diameter = along(table, "diameter", Dim::LENGTH).map(|(d, profile)| (0.5 * d, profile));
        let scale = match table.get("section_scale") {
            Some(v) => along_value(&v, Dim::NUMBER).map(|scale| (scale, Some(v))),
            None => Some(((1.0, Profile::default()), None)),
        };
        let said = ["size", "radius", "diameter"].iter().any(|k| table.has(k));
        let ((largest, scale), scaled) = scale?;
        // What was given and wrong is reported already.
        let section = section.map_or(Some(Section::Round), |s| s)?.scaled(largest);
        if said {
            let (radius, profile) = radius.or(diameter).or(preset.map(|r| (r, Profile::default())))?;
            let varies = profile != Profile::default();
            if let (true, Some(value)) = (varies, &scaled) {
                value.problem("`section_scale` and a radius along the thread exclude each other", None);
            } else if varies && section != Section::Round {
                let value = table.get("radius").or(table.get("diameter"))?;
                value.problem(
                    "a section that is not round touches with one radius",
                    Some("`section_scale` changes its size along the thread".into()),
                );
            }
            let radius = if section == Section::Round { radius * largest } else { radius };
            Some((section, radius, if varies { profile } else { scale }))
        } else {
            let half = section.half_width();
            if half.is_none() {
                table.problem("`size`, `diameter` or `radius` is missing", None);
            }
            Some((section, half?, scale))
        }
    }

    /// Material with the largest modulus and density along the thread, and both over these.
    pub(super) fn material(&self, table: &Table<'d>) -> Option<(Material, Profile, Profile)> {
        let mut failed = false;
        let preset = table.get("material").and_then(|v| match presets::find_material(&v.text()?) {
            Ok(m) => Some(m),
            Err(e) => {
                v.problem(e.to_string(), None);
                failed = true;
                None
            }
        });
        let e = along(table, "young_modulus", Dim::PRESSURE)
            .or(preset.map(|p| (p.young_modulus.value, Profile::default())));
        let density = along(table, "density", Dim::DENSITY).or(preset.map(|p| (p.density.value, Profile::default())));
        let shear = shear(table);
        let bend_scale = bend_scale(table).or(preset.map(|p| p.bend_scale.value)).unwrap_or(1.0);
        let bend_damping = bend_damping(table).or(preset.map(|p| p.bend_damping.value)).unwrap_or(0.0);
        let plasticity = table.get("plasticity").and_then(|v| plasticity(&v));
        let (Some((young_modulus, modulus_along)), Some((density, density_along))) = (e, density) else {
            if !failed && !table.has("young_modulus") {
                table.problem(
                    "`material` or `young_modulus` is missing",
                    Some(format!("materials: {}", names_of_materials())),
                );
            } else if !failed && !table.has("density") {
                table.problem("`density` is missing (or name a `material`)", None);
            }
            return None;
        };
        let shear = shear.unwrap_or(Shear::Poisson(preset.map_or(0.4, |p| p.poisson_ratio.value)));
        Some((
            Material { young_modulus, shear, density, bend_scale, bend_damping, plasticity },
            modulus_along,
            density_along,
        ))
    }

    /// The particles of a thread (or of a rest shape with a given number of elements).
    pub(super) fn centerline(&self, table: &Table<'d>, given: Option<usize>) -> Option<Vec<DVec3>> {
        const SHAPES: [&str; 5] = ["line", "arc", "helix", "points", "path"];
        let elements = match given {
            Some(n) => Some(n),
            None => table.get("elements").and_then(|v| {
                let n = v.integer(1, MAX_ELEMENTS as i64)? as usize;
                let before: usize = self.threads.iter().map(|t| t.spec.centerline.len() - 1).sum();
                if before + n > MAX_ELEMENTS {
                    v.problem(
                        format!(
                            "{} elements with those of the threads before it, at most {MAX_ELEMENTS} are taken",
                            before + n
                        ),
                        None,
                    );
                    return None;
                }
                Some(n)
            }),
        };
        let found: Vec<Value<'d>> = SHAPES.iter().filter_map(|k| table.get(k)).collect();
        let [shape] = found.as_slice() else {
            let message = if found.is_empty() { "the shape is missing" } else { "more than one shape is given" };
            table.problem(message, Some(format!("one of: {}", SHAPES.join(", "))));
            return None;
        };
        let curve = if table.has("line") {
            let t = shape.table()?;
            let from = t.need_vector("from", Dim::LENGTH);
            let to = match (t.get("to"), t.get("direction")) {
                (Some(to), None) => to.vector(Dim::LENGTH),
                (None, Some(d)) => {
                    let (d, length) =
                        (d.direction(), t.need("length", "a length").and_then(|v| positive_value(&v, Dim::LENGTH)));
                    from.zip(d).zip(length).map(|((from, d), l)| from + d * l)
                }
                _ => {
                    t.problem("either `to`, or `direction` and `length`", None);
                    None
                }
            };
            t.finish();
            Curve::new(vec![Piece::Line { from: from?, to: to? }])
        } else if table.has("arc") {
            let t = shape.table()?;
            let (center, axis, start) = (
                t.need_vector("center", Dim::LENGTH),
                t.need("axis", "a direction").and_then(|v| v.direction()),
                t.need_vector("start", Dim::LENGTH),
            );
            let angle = t.need_quantity("angle", Dim::ANGLE);
            t.finish();
            Curve::new(vec![curve::turn(start?, center?, axis?, angle?, 0.0)])
        } else if table.has("helix") {
            let t = shape.table()?;
            let (center, axis, start) = (
                t.need_vector("center", Dim::LENGTH),
                t.need("axis", "a direction").and_then(|v| v.direction()),
                t.need_vector("start", Dim::LENGTH),
            );
            let (pitch, turns) =
                (t.need_quantity("pitch", Dim::LENGTH), t.get("turns").and_then(|v| v.quantity(Dim::NUMBER)));
            let length = positive(&t, "length", Dim::LENGTH);
            if turns.is_some() == length.is_some() {
                t.problem("either `turns` or `length` of the thread", None);
            }
            t.finish();
            let (center, axis, start, pitch) = (center?, axis?, start?, pitch?);
            let arm = start - center;
            let radius = (arm - axis * axis.dot(arm)).length();
            let turns = turns.or_else(|| length.map(|l| l / (std::f64::consts::TAU * radius).hypot(pitch)))?;
            Curve::new(vec![curve::helix(start, center, axis, turns, pitch)])
        } else if table.has("points") {
            let points = self.points(shape)?;
            // As they are, unless a number of elements is wanted.
            match elements {
                Some(n) if n + 1 != points.len() => Curve::through(&points),
                _ if points.len() < 2 => {
                    shape.problem("at least two points are wanted", None);
                    return None;
                }
                _ => return Some(points),
            }
        } else {
            self.path(shape)?
        };
        let Some(n) = elements else {
            if !table.has("elements") {
                table.problem("`elements` is missing: the number of elements", None);
            }
            return None;
        };
        let cut = curve.cut(n).filter(|p| p.iter().all(|x| x.is_finite()));
        if cut.is_none() {
            shape.problem("it has no length, or is too large", None);
        }
        cut
    }

    /// Points inline, or `{ file = "..", unit = "mm" }`.
    pub(super) fn points(&self, value: &Value<'d>) -> Option<Vec<DVec3>> {
        if !value.is_table() {
            return value
                .array("an array of points, or { file = \"..\", unit = \"mm\" }")?
                .iter()
                .map(|v| v.vector(Dim::LENGTH))
                .collect();
        }
        let t = value.table()?;
        let unit = file_unit(&t);
        let text = t.need("file", "a file with three numbers a line").and_then(|v| self.file(&v));
        t.finish();
        match curve::read_points(&text?, unit?) {
            Ok(points) => Some(points),
            Err(e) => {
                value.problem(e, None);
                None
            }
        }
    }

    /// Pieces one after the other: `from`, then `line_to`, `line_by`, `arc`.
    pub(super) fn path(&self, value: &Value<'d>) -> Option<Curve> {
        let mut pieces = Vec::new();
        let mut here: Option<DVec3> = None;
        let mut fine = true;
        for (i, item) in value.array("an array of pieces, the first { from = [x, y, z] }")?.iter().enumerate() {
            let t = item.table()?;
            let to = if i == 0 {
                here = t.need_vector("from", Dim::LENGTH);
                t.finish();
                fine &= here.is_some();
                continue;
            } else if let Some(v) = t.get("line_to") {
                v.vector(Dim::LENGTH).zip(here).map(|(to, from)| Piece::Line { from, to })
            } else if let Some(v) = t.get("line_by") {
                v.vector(Dim::LENGTH).zip(here).map(|(by, from)| Piece::Line { from, to: from + by })
            } else if let Some(v) = t.get("arc") {
                let a = v.table()?;
                let (center, axis) =
                    (a.need_vector("center", Dim::LENGTH), a.need("axis", "a direction").and_then(|v| v.direction()));
                let (angle, advance) =
                    (a.need_quantity("angle", Dim::ANGLE), a.quantity_or("advance", Dim::LENGTH, 0.0));
                a.finish();
                center
                    .zip(axis)
                    .zip(angle)
                    .zip(here)
                    .map(|(((center, axis), angle), start)| curve::turn(start, center, axis, angle, advance))
            } else {
                item.problem("a piece is one of: line_to, line_by, arc", None);
                None
            };
            t.finish();
            match to {
                Some(piece) => {
                    here = Some(piece.at(1.0));
                    pieces.push(piece);
                }
                None => fine = false,
            }
        }
        // A piece without length has no direction.
        pieces.retain(|p| p.length() > 0.0);
        fine.then(|| Curve::new(pieces))
    }

    pub(super) fn rest(&self, value: &Value<'d>, n: usize, closed: bool) -> Option<RestShape> {
        if value.is_text() {
            return value.choice(&[("straight", RestShape::Straight), ("as_inserted", RestShape::AsInserted)]);
        }
        let t = value.table()?;
        let shaped = ["line", "arc", "helix", "points", "path"].iter().any(|k| t.has(k));
        if shaped {
            let points = self.centerline(&t, Some(n));
            let twist = t.quantity_or("twist", Dim::ANGLE, 0.0);
            let hint = t.vector("d1", Dim::NUMBER);
            t.finish();
            let points = points?;
            let q = frames(&points, hint, twist)?;
            let lengths: Vec<f64> = points.windows(2).map(|p| p[0].distance(p[1])).collect();
            let joints = if closed { n } else { n - 1 };
            let next = |j: usize| (j + 1) % n;
            let darboux = (0..joints)
                .map(|j| log((q[j].conjugate() * q[next(j)]).normalize()) / (0.5 * (lengths[j] + lengths[next(j)])))
                .collect();
            return Some(RestShape::Given { lengths: Some(lengths), darboux: Some(darboux) });
        }
        let curvature = match t.get("curvature") {
            Some(v) if v.is_array() => {
                match v.quantities(Dim::CURVATURE, "two curvatures, about d1 and d2")?.as_slice() {
                    [a, b] => Some((*a, *b)),
                    _ => {
                        v.problem("wanted two curvatures, about d1 and d2", None);
                        None
                    }
                }
            }
            Some(v) => v.quantity(Dim::CURVATURE).map(|k| (k, 0.0)),
            None => Some((0.0, 0.0)),
        };
        let twist = t.quantity_or("twist", Dim::CURVATURE, 0.0);
        let length = positive(&t, "length", Dim::LENGTH);
        t.finish();
        let (k1, k2) = curvature?;
        Some(RestShape::Given {
            lengths: length.map(|l| vec![l / n as f64; n]),
            darboux: Some(vec![DVec3::new(k1, k2, twist); if closed { n } else { n.saturating_sub(1) }]),
        })
    }

    /// Places that are joined.
    pub(super) fn weld(&self, table: &Table<'d>) -> Option<WeldDef> {
        let value = table.need("places", "an array of places such as { thread = \"a\", at = \"end\" }")?;
        let mut places = Vec::new();
        for item in value.array("an array of places such as { thread = \"a\", at = \"end\" }")? {
            let t = item.table()?;
            let thread = self.thread_of(&t);
            let place = t
                .need("at", "start, end, middle, a length or \"particle 3\"")
                .zip(thread)
                .and_then(|(v, thread)| self.place(&v, thread));
            t.finish();
            places.push((thread?, place?));
        }
        let rest = match table.get("rest") {
            Some(v) => v.choice(&[
                ("as_inserted", WeldRest::AsInserted),
                ("straight", WeldRest::Straight),
                ("loose", WeldRest::Loose),
            ])?,
            None => WeldRest::AsInserted,
        };
        let anchor = match table.get("body") {
            None => None,
            Some(v) => {
                let point = table.vector("point", Dim::LENGTH).unwrap_or(DVec3::ZERO);
                Some(AnchorDef { body: self.find_body(&v)?, point, strength: positive(table, "strength", Dim::FORCE) })
            }
        };
        Some(WeldDef { places, rest, anchor, location: table.location() })
    }

    /// A reel at an end of a thread.
    pub(super) fn reel(&self, table: &Table<'d>) -> Option<ReelDef> {
        let thread = self.thread_of(table);
        let at_end = table.need("at", "start or end").and_then(|v| v.choice(&[("start", false), ("end", true)]));
        let law = reel_law(table);
        let supply = in_range(table, "supply", Dim::LENGTH, 0.0, 1e6);
        Some(ReelDef { thread: thread?, at_end: at_end?, law: law?, supply, location: table.location() })
    }

    pub(super) fn shape(&mut self, table: &Table<'d>) {
        let index = self.shapes.len();
        let name = table
            .need("name", "the name of the shape")
            .and_then(|v| v.text())
            .map_or(format!("shape{index}"), std::borrow::Cow::into_owned);
        let geometry = self.geometry(table);
        let open = table.truth_or("open", false);
        if let (Some(value), Some(other)) = (table.get("open"), &geometry)
            && !matches!(other, Geometry::Mesh { .. })
        {
            value.problem("only a mesh may be open", None);
        }
        let pose = pose(table);
        let surface = self.surface(table, 1);
        // A stand-in for what was reported keeps the numbers of the following shapes right.
        let geometry = geometry.unwrap_or(Geometry::Sphere { radius: 1.0 });
        // Any shape may be moved or pushed by an action; one that never is stays where it is.
        let spec = ShapeSpec { geometry, pose, surface, motion: ShapeMotion::Driven, open };
        self.shapes.push(ShapeDef { name, spec, location: table.location() });
    }

    pub(super) fn geometry(&self, table: &Table<'d>) -> Option<Geometry> {
        let kinds = [("plane", 0), ("sphere", 1), ("capsule", 2), ("cylinder", 3), ("box", 4), ("mesh", 5)];
        let kind = table.need("kind", "plane, sphere, capsule, cylinder, box or mesh")?.choice(&kinds)?;
        let length = |key: &str| table.need(key, "a length").and_then(|v| positive_value(&v, Dim::LENGTH));
        match kind {
            0 => Some(Geometry::Plane),
            1 => Some(Geometry::Sphere { radius: length("radius")? }),
            2 | 3 => {
                let (radius, half_length) = (length("radius"), length("length").map(|l| 0.5 * l));
                let (radius, half_length) = (radius?, half_length?);
                Some(if kind == 2 {
                    Geometry::Capsule { radius, half_length }
                } else {
                    Geometry::Cylinder { radius, half_length }
                })
            }
            4 => {
                let sides = table.need("sides", "three lengths")?;
                let half_sides = sides.vector(Dim::LENGTH)? * 0.5;
                if half_sides.min_element() <= 0.0 {
                    sides.problem("sides must be > 0", None);
                    return None;
                }
                Some(Geometry::Box { half_sides })
            }
            _ => {
                if let Some(file) = table.get("file") {
                    let unit = file_unit(table);
                    let text = self.file(&file)?;
                    return match curve::read_obj(&text, unit?) {
                        Ok((vertices, triangles)) => Some(Geometry::Mesh { vertices, triangles }),
                        Err(e) => {
                            file.problem(e, None);
                            None
                        }
                    };
                }
                let vertices: Option<Vec<DVec3>> = table
                    .need("vertices", "corners, or a `file`")
                    .and_then(|v| v.array("an array of corners")?.iter().map(|v| v.vector(Dim::LENGTH)).collect());
                let triangles: Option<Vec<[u32; 3]>> =
                    table.need("triangles", "three corner numbers each, from 0").and_then(|v| {
                        v.array("an array of triangles")?
                            .iter()
                            .map(|v| {
                                let corners: Vec<u32> = v
                                    .array("three corner numbers")?
                                    .iter()
                                    .filter_map(|c| c.integer(0, 1 << 30))
                                    .map(|c| c as u32)
                                    .collect();
                                <[u32; 3]>::try_from(corners).ok().or_else(|| {
                                    v.problem("a triangle has three corners", None);
                                    None
                                })
                            })
                            .collect()
                    });
                Some(Geometry::Mesh { vertices: vertices?, triangles: triangles? })
            }
        }
    }
}

/// `{ ellipse = [a, b] }` or `{ rectangle = [a, b] }`.
fn section(value: &Value<'_>) -> Option<Section> {
    if value.is_text() {
        return value.choice(&[("round", Section::Round)]);
    }
    let t = value.table()?;
    let lengths = |v: &Value<'_>| {
        let found = v.quantities(Dim::LENGTH, "two lengths, along d1 and d2")?;
        match found.as_slice() {
            [a, b] if *a > 0.0 && *b > 0.0 => Some([*a, *b]),
            _ => {
                v.problem("wanted two lengths > 0, along d1 and d2", None);
                None
            }
        }
    };
    let found = match (t.get("ellipse"), t.get("rectangle")) {
        (Some(v), None) => lengths(&v).map(Section::Ellipse),
        (None, Some(v)) => lengths(&v).map(Section::Rectangle),
        _ => {
            t.problem("either `ellipse`, its semi-axes, or `rectangle`, its sides", None);
            None
        }
    };
    t.finish();
    found
}

/// A quantity > 0, or one along the thread: the largest value and the profile over it.
fn along(table: &Table<'_>, key: &str, dim: Dim) -> Option<(f64, Profile)> {
    along_value(&table.get(key)?, dim)
}

fn along_value(value: &Value<'_>, dim: Dim) -> Option<(f64, Profile)> {
    if !value.is_array() {
        return positive_value(value, dim).map(|v| (v, Profile::default()));
    }
    let mut points: Vec<(f64, f64)> = Vec::new();
    for pair in value.array("an array of pairs")? {
        let wanted = "a pair: rest length from the start, and the value there";
        let items = pair.array(wanted)?;
        let [arc, there] = items.as_slice() else {
            pair.problem(format!("wanted {wanted}"), None);
            return None;
        };
        let (s, v) = (arc.quantity(Dim::LENGTH)?, positive_value(there, dim)?);
        if points.last().is_some_and(|(before, _)| s <= *before) {
            arc.problem("lengths from the start must grow from pair to pair", None);
            return None;
        }
        points.push((s, v));
    }
    let Some(largest) = points.iter().map(|(_, v)| *v).reduce(f64::max) else {
        value.problem("at least one pair is wanted: rest length from the start, and the value there", None);
        return None;
    };
    points.iter_mut().for_each(|(_, v)| *v /= largest);
    Some((largest, Profile(points)))
}

fn shear(table: &Table<'_>) -> Option<Shear> {
    let nu = in_range(table, "poisson_ratio", Dim::NUMBER, -0.999_999, 0.5);
    let g = positive(table, "shear_modulus", Dim::PRESSURE);
    if nu.is_some() && g.is_some() {
        table.problem("`poisson_ratio` and `shear_modulus` exclude each other", None);
    }
    g.map(Shear::Modulus).or(nu.map(Shear::Poisson))
}

fn bend_scale(table: &Table<'_>) -> Option<f64> {
    in_range(table, "bend_scale", Dim::NUMBER, 1e-12, 1.0)
}

fn bend_damping(table: &Table<'_>) -> Option<f64> {
    in_range(table, "bend_damping", Dim::TIME, 0.0, 1e6)
}

fn stretch(table: &Table<'_>) -> Option<Stretch> {
    table.get("stretch")?.choice(&[("elastic", Stretch::Elastic), ("inextensible", Stretch::Inextensible)])
}

fn plasticity(value: &Value<'_>) -> Option<Plasticity> {
    let t = value.table()?;
    let yield_curvature =
        t.need("yield_curvature", "a curvature (1/m)").and_then(|v| positive_value(&v, Dim::CURVATURE));
    let yield_twist = positive(&t, "yield_twist", Dim::CURVATURE);
    let hardening = in_range(&t, "hardening", Dim::NUMBER, 0.0, 0.999_999).unwrap_or(0.0);
    t.finish();
    let yield_curvature = yield_curvature?;
    Some(Plasticity { yield_curvature, yield_twist: yield_twist.unwrap_or(yield_curvature), hardening })
}

/// What an action changes of what a thread is made of.
pub(super) fn remake(table: &Table<'_>) -> Remake {
    let plasticity = table.get("plasticity").and_then(|v| match v.is_text() {
        true => v.choice(&[("none", None)]),
        false => plasticity(&v).map(Some),
    });
    let change = Remake {
        young_modulus: positive(table, "young_modulus", Dim::PRESSURE),
        shear: shear(table),
        density: positive(table, "density", Dim::DENSITY),
        bend_scale: bend_scale(table),
        bend_damping: bend_damping(table),
        plasticity,
        stretch: stretch(table),
    };
    const KEYS: [&str; 8] = [
        "young_modulus",
        "poisson_ratio",
        "shear_modulus",
        "density",
        "bend_scale",
        "bend_damping",
        "plasticity",
        "stretch",
    ];
    if !KEYS.iter().any(|k| table.has(k)) {
        table.problem("what of the material changes?", Some(format!("any of: {}", KEYS.join(", "))));
    }
    change
}

/// Knot-pull strength: as given, or the limit for size and material. (A name that is no preset's is reported where the
/// number is used.)
fn strength(table: &Table<'_>) -> Option<Strength> {
    if let Some(value) = positive(table, "knot_pull_strength", Dim::FORCE) {
        return Some(Strength { value, of: "as given".into() });
    }
    let size = presets::find_size(&table.text("size")?).ok()?;
    let material = table.text("material").and_then(|m| presets::find_material(&m).ok());
    let limit = presets::knot_pull(size, material)?;
    let unverified = if limit.verified { "" } else { ", unverified" };
    Some(Strength { value: limit.value, of: format!("least of USP size {}{unverified}", size.name) })
}

fn names_of_materials() -> String {
    presets::materials().iter().map(|m| m.name).collect::<Vec<_>>().join(", ")
}

/// Frames along points, the first director nearest to `hint`, turned evenly by `twist` over the length.
/// Elements of a thread.
/// Rest lengths of the elements of a thread \[m\].
pub(super) fn rest_lengths(spec: &RodSpec) -> Vec<f64> {
    match &spec.rest {
        RestShape::Given { lengths: Some(lengths), .. } => lengths.clone(),
        _ => {
            let points = &spec.centerline;
            let closing = spec.closure.map(|_| points[0].distance(points[points.len() - 1]));
            points.windows(2).map(|p| p[0].distance(p[1])).chain(closing).collect()
        }
    }
}

pub(super) fn n_elements(spec: &RodSpec) -> usize {
    spec.centerline.len() - usize::from(spec.closure.is_none())
}

fn frames(points: &[DVec3], hint: Option<DVec3>, twist: f64) -> Option<Vec<DQuat>> {
    let distinct = points.windows(2).all(|p| p[0].distance(p[1]) > 0.0);
    if !distinct {
        return None; // the engine names the two points
    }
    let bend = points
        .windows(3)
        .map(|w| (w[1] - w[0]).normalize().cross((w[2] - w[1]).normalize()))
        .find(|c| c.length() > 1e-6);
    let q = transported_frames(points, hint.or(bend).unwrap_or(DVec3::ZERO));
    let n = q.len() as f64;
    Some(q.iter().enumerate().map(|(i, q)| (*q * exp(DVec3::Z * (twist * (i as f64 + 0.5) / n))).normalize()).collect())
}

/// `rate` or `brake`.
pub(super) fn reel_law(table: &Table<'_>) -> Option<ReelLaw> {
    match (table.get("rate"), table.get("brake")) {
        (Some(v), None) => in_range_value(&v, Dim::SPEED, -100.0, 100.0).map(ReelLaw::Rate),
        (None, Some(v)) => positive_value(&v, Dim::FORCE).map(ReelLaw::Brake),
        _ => {
            table.problem("either `rate`, a speed, or `brake`, a force", None);
            None
        }
    }
}
