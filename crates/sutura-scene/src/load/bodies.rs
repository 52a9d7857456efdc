//! Free bodies.

use super::*;
use crate::scene::BodyDef;
use sutura::{BodySpec, ColliderSpec};

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
        self.bodies.push(BodyDef { name, spec, location: table.location() });
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
