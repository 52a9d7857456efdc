//! Bodies and needles.

use super::*;
use crate::scene::{AnchorDef, BodyDef, WeldDef};
use sutura::{BodySpec, ColliderSpec, NEEDLES, NeedlePoint, NeedleShape, NeedleSpec, WeldRest};

/// A solid of a body, and where it stands in the file.
type Part = (ColliderSpec, Location);

impl<'d> Loader<'d> {
    pub(super) fn body(&mut self, table: &Table<'d>) {
        let index = self.bodies.len();
        let name = table
            .need("name", "the name of the body")
            .and_then(|v| v.text())
            .map_or(format!("body{index}"), std::borrow::Cow::into_owned);
        let pose = pose(table);
        let velocity = table.vector("velocity", Dim::SPEED).unwrap_or(DVec3::ZERO);
        let angular_velocity = table.vector("angular_velocity", Dim::SPIN).unwrap_or(DVec3::ZERO);
        let density = positive(table, "density", Dim::DENSITY);
        let surface = self.surface(table, 1);
        let several = table.get("parts");
        let parts = match &several {
            Some(value) => self.parts(table, value, density, surface),
            None => self.part(table, table, density, surface).map(|p| vec![(p, table.location())]),
        };
        // What is missing was reported; a stand-in keeps the numbers of what follows right.
        let parts = parts.unwrap_or_else(|| {
            let solid = BodySpec::solid(Geometry::Sphere { radius: 1.0 }, 1.0, Pose::IDENTITY);
            solid.colliders.into_iter().map(|c| (c, table.location())).collect()
        });
        for (k, (part, location)) in parts.iter().enumerate() {
            let spec = ShapeSpec {
                geometry: part.geometry.clone(),
                pose: pose.compose(&part.pose),
                surface,
                motion: ShapeMotion::OnBody,
                open: false,
            };
            let name = if several.is_some() { format!("{name}.{k}") } else { name.clone() };
            self.shapes.push(ShapeDef { name, spec, location: location.clone() });
        }
        let colliders = parts.into_iter().map(|(part, _)| part).collect();
        let spec = BodySpec { pose, colliders, velocity, angular_velocity };
        self.add_body(table, name, spec, None);
    }

    fn add_body(&mut self, table: &Table<'d>, name: String, spec: BodySpec, tip: Option<DVec3>) {
        let driven = table.truth_or("driven", false);
        let held = table.has("held_by");
        if let Some(value) = table.get("driven").filter(|_| driven && held) {
            value.problem("`driven` and `held_by` exclude each other", None);
        }
        self.bodies.push(BodyDef { name, spec, driven, held_by: None, tip, location: table.location() });
    }

    /// A needle: a body, and what its thread is swaged into, if there is one.
    pub(super) fn needle(&mut self, table: &Table<'d>) -> Option<WeldDef> {
        let name = table
            .need("name", "the name of the needle")
            .and_then(|v| v.text())
            .map_or(format!("body{}", self.bodies.len()), std::borrow::Cow::into_owned);
        let needle = self.needle_spec(table);
        let swage = table.get("swage").and_then(|v| self.thread_end(&v));
        let strength = positive(table, "strength", Dim::FORCE);
        let pose = match (&swage, &needle) {
            (Some((thread, place)), Some(needle)) => {
                for key in ["position", "orientation"] {
                    if let Some(value) = table.get(key) {
                        value
                            .problem(format!("`swage` says where the needle is: `{key}` has no place beside it"), None);
                    }
                }
                let points = &self.threads[*thread].spec.centerline;
                let n = points.len() - 1;
                let (at, before) =
                    if *place == Place::End { (points[n], points[n - 1]) } else { (points[0], points[1]) };
                let toward = table.need("toward", "the direction in which it bends, such as [0, 0, 1]");
                let toward = toward.and_then(|v| v.direction()).unwrap_or(DVec3::Z);
                needle.pose(at, at - before, toward)
            }
            _ => pose(table),
        };
        // A stand-in for what was reported keeps the numbers of what follows right.
        let needle =
            needle.unwrap_or_else(|| NeedleSpec::new(NeedleShape::HalfCircle, 0.017, 5e-4, NeedlePoint::Taper));
        let spec = match needle.body(pose) {
            Ok(spec) => spec,
            Err(e) => {
                table.problem(e.to_string(), None);
                BodySpec::solid(Geometry::Sphere { radius: 1.0 }, 1.0, Pose::IDENTITY)
            }
        };
        for (k, part) in spec.colliders.iter().enumerate() {
            let pose = pose.compose(&part.pose);
            let (geometry, motion) = (part.geometry.clone(), ShapeMotion::OnBody);
            let spec = ShapeSpec { geometry, pose, surface: part.surface, motion, open: false };
            self.shapes.push(ShapeDef { name: format!("{name}.{k}"), spec, location: table.location() });
        }
        let body = self.bodies.len();
        self.add_body(table, name, spec, Some(needle.tip().position));
        let anchor = Some(AnchorDef { body, point: DVec3::ZERO, strength });
        swage.map(|place| WeldDef {
            places: vec![place],
            rest: WeldRest::AsInserted,
            anchor,
            location: table.location(),
        })
    }

    /// By its code, or by shape, length, wire and point; each of these overrides the code's.
    fn needle_spec(&mut self, table: &Table<'d>) -> Option<NeedleSpec> {
        const SHAPES: [(&str, NeedleShape); 5] = [
            ("straight", NeedleShape::Straight),
            ("1/4", NeedleShape::QuarterCircle),
            ("3/8", NeedleShape::ThreeEighthsCircle),
            ("1/2", NeedleShape::HalfCircle),
            ("5/8", NeedleShape::FiveEighthsCircle),
        ];
        const POINTS: [(&str, NeedlePoint); 4] = [
            ("taper", NeedlePoint::Taper),
            ("cutting", NeedlePoint::Cutting),
            ("reverse_cutting", NeedlePoint::ReverseCutting),
            ("blunt", NeedlePoint::Blunt),
        ];
        let surface = self.surface(table, 1);
        let code = match table.get("code") {
            None => None,
            Some(value) => {
                let text = value.text()?;
                let found = NEEDLES.iter().find(|n| n.code.eq_ignore_ascii_case(text.trim()));
                if found.is_none() {
                    let codes = NEEDLES.map(|n| n.code);
                    value.problem(format!("no needle has the code `{text}`"), suggest(&text, codes));
                    return None;
                }
                found
            }
        };
        let wanted = "a shape (straight, 1/4, 3/8, 1/2 or 5/8), or a `code`";
        let given = |key: &str, wanted: &str| match (table.get(key), code) {
            (None, None) => table.need(key, wanted),
            (value, _) => value,
        };
        let shape = given("shape", wanted).map_or(code.map(|c| c.shape), |v| v.choice(&SHAPES));
        let length = |v: Value<'d>| positive_value(&v, Dim::LENGTH);
        let arc = given("length", "the length of the arc, or a `code`").map_or(code.map(|c| c.length), length);
        let wire = given("wire", "the diameter of the wire, or a `code`").map_or(code.map(|c| c.wire), length);
        let point = Some(code.map_or(NeedlePoint::Taper, |c| c.point));
        let point = table.get("point").map_or(point, |v| v.choice(&POINTS));
        let density = positive(table, "density", Dim::DENSITY);
        let spec = NeedleSpec::new(shape?, arc?, wire?, point?);
        Some(NeedleSpec { density: density.unwrap_or(spec.density), surface, ..spec })
    }

    /// An end of a thread, told as `\"thread.end\"`.
    fn thread_end(&self, value: &Value<'d>) -> Option<(usize, Place)> {
        let text = value.text()?;
        let found = text.rsplit_once('.').and_then(|(thread, end)| {
            let place = [("start", Place::Start), ("end", Place::End)].iter().find(|(name, _)| *name == end)?.1;
            Some((self.threads.iter().position(|t| t.name == thread)?, place))
        });
        if found.is_none() {
            let all = self.threads.iter().flat_map(|t| ["start", "end"].map(|end| format!("{}.{end}", t.name)));
            let all = all.collect::<Vec<_>>().join(", ");
            value.problem(format!("`{text}` is no end of a thread"), Some(format!("ends: {all}")));
        }
        found
    }

    fn parts(&self, table: &Table<'d>, value: &Value<'d>, density: Option<f64>, surface: u32) -> Option<Vec<Part>> {
        if let Some(kind) = table.get("kind") {
            kind.problem("`kind` and `parts` exclude each other", None);
        }
        let tables = table.tables("parts");
        if tables.is_empty() && value.is_array() {
            value.problem("at least one part is wanted", None);
        }
        let mut parts = Vec::new();
        for part in &tables {
            let found = self.part(part, table, density, surface);
            let at = pose(part);
            part.finish();
            parts.push(found.map(|p| (ColliderSpec { pose: at, ..p }, part.location())));
        }
        parts.into_iter().collect::<Option<Vec<_>>>().filter(|p| !p.is_empty())
    }

    /// A solid in the frame of `table`, with the density there or that of the whole body.
    fn part(&self, table: &Table<'d>, body: &Table<'d>, density: Option<f64>, surface: u32) -> Option<ColliderSpec> {
        let geometry = self.geometry(table);
        let wanted = "kilograms in a cubic meter, such as \"1000 kg/m^3\"";
        let density = match body.has("density") && !table.has("density") {
            true => density,
            false => table.need("density", wanted).and_then(|v| positive_value(&v, Dim::DENSITY)),
        };
        let geometry = geometry?;
        // The engine knows what a solid is; asked for each part it shows which is none.
        if let Some(value) = ["file", "vertices", "kind"].into_iter().find_map(|key| table.get(key)) {
            if geometry == Geometry::Plane {
                value.problem("a body is solid and has an end: a plane is none", None);
                return None;
            }
            if let Err(e) = BodySpec::solid(geometry.clone(), 1.0, Pose::IDENTITY).mass_properties() {
                value.problem(format!("a body is a closed solid. {e}"), None);
                return None;
            }
        }
        Some(ColliderSpec { geometry, pose: Pose::IDENTITY, density: density?, surface })
    }
}
