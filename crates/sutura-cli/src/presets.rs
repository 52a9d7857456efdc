//! The command `sutura presets`: sizes and materials with their sources.

use crate::args::Presets;
use crate::{say, say_json, table};
use serde_json::{Value, json};
use sutura_scene::presets::{Figure, materials, sizes};

/// Runs the command.
pub fn presets(args: &Presets) -> anyhow::Result<()> {
    if args.json { say_json(&as_json()) } else { say(&as_tables()) }
}

fn as_json() -> Value {
    let figure = |f: &Figure| json!({ "value": f.value, "unit": f.unit, "source": f.source, "verified": f.verified });
    let sizes: Vec<Value> = sizes()
        .iter()
        .map(|s| {
            json!({
                "name": s.name,
                "metric": s.metric,
                "diameter_range_m": [s.diameter_range.0, s.diameter_range.1],
                "diameter": figure(&s.diameter),
                "knot_pull_absorbable": s.knot_pull_absorbable.as_ref().map(figure),
                "knot_pull_nonabsorbable": s.knot_pull_nonabsorbable.as_ref().map(figure),
            })
        })
        .collect();
    let materials: Vec<Value> = materials()
        .iter()
        .map(|m| {
            let figures: serde_json::Map<String, Value> =
                m.figures().iter().map(|(key, f)| ((*key).to_string(), figure(f))).collect();
            json!({ "name": m.name, "title": m.title, "figures": figures })
        })
        .collect();
    json!({ "sizes": sizes, "materials": materials })
}

/// Sources in the order of their first use, each named by its number.
#[derive(Default)]
struct Sources(Vec<&'static str>);

impl Sources {
    /// The number as shown: scaled, `*` when unverified, and the number of its source.
    fn cite(&mut self, figure: &Figure, scale: f64) -> String {
        let at = self.0.iter().position(|s| *s == figure.source).unwrap_or_else(|| {
            self.0.push(figure.source);
            self.0.len() - 1
        });
        let value = crate::plot::number(figure.value * scale);
        format!("{value}{} [{}]", if figure.verified { "" } else { "*" }, at + 1)
    }
}

fn as_tables() -> String {
    let mut sources = Sources::default();
    let mut size_table = table(
        &[
            "USP size",
            "metric",
            "diameter [mm]",
            "allowed [mm]",
            "knot pull, absorbable [N]",
            "knot pull, nonabsorbable [N]",
        ],
        &[1, 2, 3, 4, 5],
    );
    for s in sizes() {
        let pull =
            |f: &Option<Figure>, sources: &mut Sources| f.as_ref().map_or_else(|| "-".into(), |f| sources.cite(f, 1.0));
        let (low, high) = s.diameter_range;
        size_table.add_row([
            s.name.to_string(),
            crate::plot::number(s.metric),
            sources.cite(&s.diameter, 1e3),
            format!("{}-{}", crate::plot::number(low * 1e3), crate::plot::number(high * 1e3)),
            pull(&s.knot_pull_absorbable, &mut sources),
            pull(&s.knot_pull_nonabsorbable, &mut sources),
        ]);
    }
    let mut material_table = table(
        &[
            "material",
            "what it is",
            "E [GPa]",
            "Poisson's ratio",
            "density [kg/m³]",
            "bend scale",
            "bend damping [ms]",
            "friction",
        ],
        &[2, 3, 4, 5, 6, 7],
    );
    for m in materials() {
        material_table.add_row([
            m.name.to_string(),
            m.title.to_string(),
            sources.cite(&m.young_modulus, 1e-9),
            sources.cite(&m.poisson_ratio, 1.0),
            sources.cite(&m.density, 1.0),
            sources.cite(&m.bend_scale, 1.0),
            sources.cite(&m.bend_damping, 1e3),
            sources.cite(&m.friction, 1.0),
        ]);
    }
    let list: Vec<String> = sources.0.iter().enumerate().map(|(i, s)| format!("  [{}] {s}", i + 1)).collect();
    format!(
        "{size_table}\n\n{material_table}\n\n* unverified: recalled or assumed, not read in the source named; replace it where it matters\n\nSources\n{}",
        list.join("\n")
    )
}
