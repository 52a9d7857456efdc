//! What can be changed while a scene runs: settings and solver, friction, what threads are made of. What the scene had
//! at its beginning is remembered.

use crate::source::Play;
use crate::stage::Stage;
use bevy::prelude::*;
use bevy_egui::egui::{self, Color32, RichText, Slider, SliderClamping, Ui, emath::Numeric};
use std::ops::RangeInclusive;
use sutura_bevy::Sutura;
use sutura_bevy::sutura::{
    self, Friction, Handle, Integrator, Material, PaperSettings, Plasticity, Rod, Settings, Shear, Solver, Stretch,
    SweepOrder, World as Engine,
};

/// One change of the world.
#[derive(Debug, Clone, PartialEq)]
pub enum Change {
    /// Other settings, the solver among them.
    Settings(Settings),
    /// Friction between two surfaces.
    Friction(u32, u32, Friction),
    /// What a thread is made of.
    Material(Handle<Rod>, Material),
    /// Whether it stretches.
    Stretch(Handle<Rod>, Stretch),
}

/// Changes that are wanted, and how things were.
#[derive(Resource, Debug, Default)]
pub struct Parameters {
    /// What the panel wants changed before the next frame of physics, in order.
    pub wanted: Vec<Change>,
    /// What the engine refused last, and why; until it takes something.
    pub error: Option<String>,
    /// Everything as the scene had it at its beginning, in the order in which it is put back. A solver that knows less
    /// comes after what it does not know.
    had: Vec<Change>,
    /// The opening of a scene of which that is.
    generation: u64,
    /// Numbers of the paper's solver while it is not in use.
    paper: PaperSettings,
}

impl Parameters {
    /// What is not as the scene had it, as the changes that put it back.
    pub fn changed(&self, world: &Engine) -> Vec<Change> {
        self.had.iter().filter(|c| !is_so(world, c)).cloned().collect()
    }
}

/// Whether the world already is as a change would make it.
fn is_so(world: &Engine, change: &Change) -> bool {
    match change {
        Change::Settings(settings) => world.settings() == settings,
        Change::Friction(a, b, friction) => world.friction(*a, *b) == *friction,
        Change::Material(rod, material) => world.rod(*rod).is_ok_and(|r| r.material() == material),
        Change::Stretch(rod, stretch) => world.rod(*rod).is_ok_and(|r| r.stretch() == *stretch),
    }
}

/// Pairs of surfaces that may touch.
fn pairs(world: &Engine) -> Vec<(u32, u32)> {
    let view = world.view();
    let threads: Vec<u32> = view.rods().map(|r| r.surface()).collect();
    let mut surfaces: Vec<u32> = threads.iter().copied().chain(view.shapes().map(|s| s.surface)).collect();
    surfaces.sort_unstable();
    surfaces.dedup();
    let all = surfaces.iter().enumerate().flat_map(|(i, a)| surfaces[i..].iter().map(|b| (*a, *b)));
    // Shapes do not touch each other.
    all.filter(|(a, b)| threads.contains(a) || threads.contains(b)).collect()
}

/// Remembers how a scene that was opened has things.
pub fn remember(mut parameters: ResMut<Parameters>, stage: Res<Stage>, sutura: Res<Sutura>) {
    if parameters.generation == stage.generation {
        return;
    }
    *parameters = Parameters { generation: stage.generation, ..Parameters::default() };
    let Some(play) = sutura.simulation::<Play>() else { return };
    let world = sutura.world();
    for (_, rod) in play.0.threads() {
        if let Ok(r) = world.rod(rod) {
            parameters.had.extend([Change::Stretch(rod, r.stretch()), Change::Material(rod, r.material().clone())]);
        }
    }
    parameters.had.extend(pairs(world).into_iter().map(|(a, b)| Change::Friction(a, b, world.friction(a, b))));
    parameters.had.push(Change::Settings(world.settings().clone()));
    if let Solver::Paper(numbers) = world.settings().solver {
        parameters.paper = numbers;
    }
}

/// Does what is wanted; everything goes through the recorder.
pub fn apply(mut parameters: ResMut<Parameters>, mut sutura: ResMut<Sutura>) {
    if parameters.wanted.is_empty() {
        return;
    }
    for change in std::mem::take(&mut parameters.wanted) {
        let world = sutura.edit();
        let result = match &change {
            Change::Settings(settings) => world.set_settings(settings.clone()),
            Change::Friction(a, b, friction) => world.set_friction(*a, *b, *friction),
            Change::Material(rod, material) => world.set_material(*rod, material),
            Change::Stretch(rod, stretch) => world.set_stretch(*rod, *stretch),
        };
        parameters.error = result.err().map(|e: sutura::Error| e.to_string());
        if parameters.error.is_some() {
            break;
        }
    }
}

/// What can be changed of the world, for the panel.
pub(crate) fn show(ui: &mut Ui, world: &mut World) {
    let (parameters, sutura) = (world.resource::<Parameters>(), world.resource::<Sutura>());
    let engine = sutura.world();
    let mut wanted = Vec::new();
    let changed = parameters.changed(engine);
    ui.horizontal(|ui| {
        let back = ui.add_enabled(!changed.is_empty(), egui::Button::new("as the scene had it"));
        if back.on_hover_text("materials, friction, solver and damping as at the beginning of the scene").clicked() {
            wanted.clone_from(&changed);
        }
        if !changed.is_empty() {
            ui.label(RichText::new("changed").color(Color32::from_rgb(255, 190, 80)));
        }
    });
    if let Some(error) = &parameters.error {
        ui.colored_label(Color32::from_rgb(255, 120, 90), error);
    }
    let mut numbers = parameters.paper;
    let mut settings = engine.settings().clone();
    settings_ui(ui, &mut settings, &mut numbers);
    if settings != *engine.settings() {
        wanted.push(Change::Settings(settings));
    }
    ui.collapsing("Friction", |ui| {
        for (a, b) in pairs(engine) {
            let mut now = engine.friction(a, b);
            ui.label(format!("surfaces {a} and {b}"));
            ui.push_id((a, b), |ui| friction_ui(ui, &mut now));
            if now != engine.friction(a, b) {
                wanted.push(Change::Friction(a, b, now));
            }
        }
    });
    let threads: Vec<(String, Handle<Rod>)> = sutura
        .simulation::<Play>()
        .map(|p| p.0.threads().map(|(name, rod)| (name.to_owned(), rod)).collect())
        .unwrap_or_default();
    for (name, rod) in &threads {
        let Ok(r) = engine.rod(*rod) else { continue };
        egui::CollapsingHeader::new(format!("Material of {name}")).default_open(threads.len() == 1).show(ui, |ui| {
            let [thick, long] = [2.0 * r.radius(), r.rest_length()].map(|x| readable(1e3 * x, "mm", false));
            ui.label(format!("{thick} thick, {long} long, {} elements", r.n_elements()));
            let (mut material, mut stretch) = (r.material().clone(), r.stretch());
            material_ui(ui, &mut material, &mut stretch);
            if material != *r.material() {
                wanted.push(Change::Material(*rod, material));
            }
            if stretch != r.stretch() {
                wanted.push(Change::Stretch(*rod, stretch));
            }
        });
    }
    let mut parameters = world.resource_mut::<Parameters>();
    parameters.paper = numbers;
    parameters.wanted.extend(wanted);
}

/// A number with its unit, with a prefix where the unit takes one: four digits of it.
fn readable(value: f64, unit: &str, prefixed: bool) -> String {
    const PREFIXES: [(f64, &str); 7] =
        [(1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n")];
    let (scale, prefix) = match PREFIXES.iter().find(|(scale, _)| value.abs() >= 0.9999 * scale) {
        Some(found) if prefixed => *found,
        _ => (1.0, ""),
    };
    let value = value / scale;
    let decimals = if value == 0.0 { 0 } else { (3.0 - value.abs().log10().floor()).clamp(0.0, 9.0) as usize };
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    format!("{text} {prefix}{unit}").trim_end().to_owned()
}

/// A slider that changes nothing unless it is moved: what lies beyond its ends stays there.
fn slider<'a, N: Numeric>(value: &'a mut N, range: RangeInclusive<N>) -> Slider<'a> {
    Slider::new(value, range).clamping(SliderClamping::Edits)
}

/// The same over decades, with a unit, which may be typed too.
fn decades<'a>(value: &'a mut f64, range: RangeInclusive<f64>, unit: &'static str, prefixed: bool) -> Slider<'a> {
    let parse = move |text: &str| sutura_scene::in_si(text.trim(), unit).ok().or_else(|| text.trim().parse().ok());
    slider(value, range)
        .logarithmic(true)
        .custom_formatter(move |v, _| readable(v, unit, prefixed))
        .custom_parser(parse)
}

fn settings_ui(ui: &mut Ui, s: &mut Settings, paper: &mut PaperSettings) {
    egui::CollapsingHeader::new("Solver and damping").default_open(true).show(ui, |ui| {
        ui.horizontal(|ui| {
            ui.label("gravity [m/s²]");
            for k in 0..3 {
                ui.add(egui::DragValue::new(&mut s.gravity[k]).speed(0.05));
            }
        });
        ui.add(decades(&mut s.substep, 1e-5..=0.05, "s", true).text("substep"));
        ui.add(slider(&mut s.linear_damping, 0.0..=0.999).text("linear damping [part/s]"));
        ui.add(slider(&mut s.angular_damping, 0.0..=0.999).text("angular damping [part/s]"));
        ui.add(slider(&mut s.linear_drag, 0.0..=1000.0).text("linear drag [1/s]"));
        ui.add(slider(&mut s.angular_drag, 0.0..=1000.0).text("angular drag [1/s]"));
        ui.horizontal(|ui| {
            ui.label("solver");
            let direct = s.solver == Solver::Direct;
            if ui.radio(direct, "direct").clicked() {
                s.solver = Solver::Direct;
            }
            if ui.radio(!direct, "of the paper").clicked() && direct {
                s.solver = Solver::Paper(*paper);
            }
        });
        match &mut s.solver {
            Solver::Direct => {
                ui.add(slider(&mut s.newton_max, 1..=50).text("Newton iterations"));
                ui.add(decades(&mut s.tolerance, 1e-5..=0.1, "rad", true).text("tolerance"));
                ui.add(slider(&mut s.halvings, 0..=12).text("halvings"));
                ui.horizontal(|ui| {
                    ui.selectable_value(&mut s.integrator, Integrator::ImplicitEuler, "implicit Euler");
                    ui.selectable_value(&mut s.integrator, Integrator::TrBdf2, "TR-BDF2");
                });
            }
            Solver::Paper(p) => {
                paper_ui(ui, p);
                *paper = *p;
            }
        }
    });
}

fn paper_ui(ui: &mut Ui, p: &mut PaperSettings) {
    ui.add(slider(&mut p.iterations, 1..=200).logarithmic(true).text("iterations"));
    ui.add(slider(&mut p.stretch_shear, 0.0..=1.0).text("stretch and shear"));
    ui.add(slider(&mut p.bend[0], 0.0..=1.0).text("bending about d1"));
    ui.add(slider(&mut p.bend[1], 0.0..=1.0).text("bending about d2"));
    ui.add(slider(&mut p.twist, 0.0..=1.0).text("twist"));
    ui.add(slider(&mut p.friction, 0.0..=1.0).text("friction"));
    ui.add(slider(&mut p.frame_inertia, 0.01..=1000.0).logarithmic(true).text("inertia of frames"));
    ui.checkbox(&mut p.direct_distance, "all lengths at once (DDC)");
    ui.horizontal(|ui| {
        ui.selectable_value(&mut p.order, SweepOrder::Natural, "one after the other");
        ui.selectable_value(&mut p.order, SweepOrder::TwoColor, "two colors");
    });
}

fn friction_ui(ui: &mut Ui, now: &mut Friction) {
    let before = *now;
    ui.add(slider(&mut now.stick, 0.0..=1.0).text("sticking"));
    ui.add(slider(&mut now.slide, 0.0..=1.0).text("sliding"));
    // What slides holds no better than what sticks: the other one follows.
    if now.slide > now.stick {
        if now.slide == before.slide { now.slide = now.stick } else { now.stick = now.slide }
    }
}

fn material_ui(ui: &mut Ui, m: &mut Material, stretch: &mut Stretch) {
    ui.add(decades(&mut m.young_modulus, 1e5..=1e12, "Pa", true).text("Young's modulus"));
    ui.horizontal(|ui| {
        ui.label("shear by");
        let poisson = matches!(m.shear, Shear::Poisson(_));
        if ui.radio(poisson, "Poisson's ratio").clicked() && !poisson {
            // The same as far as a ratio may be; rounding is not to go over a half.
            m.shear = Shear::Poisson((m.young_modulus / (2.0 * m.shear_modulus()) - 1.0).clamp(-0.99, 0.5));
        }
        if ui.radio(!poisson, "modulus").clicked() && poisson {
            m.shear = Shear::Modulus(m.shear_modulus());
        }
    });
    match &mut m.shear {
        Shear::Poisson(nu) => ui.add(slider(nu, -0.9..=0.5).text("Poisson's ratio")),
        Shear::Modulus(g) => ui.add(decades(g, 1e4..=1e12, "Pa", true).text("shear modulus")),
    };
    ui.add(decades(&mut m.density, 10.0..=30_000.0, "kg/m³", false).text("density"));
    ui.add(decades(&mut m.bend_scale, 1e-5..=1.0, "", false).text("bending scale"));
    ui.add(decades(&mut m.bend_damping, 0.0..=10.0, "s", true).smallest_positive(1e-6).text("bending damping"));
    let mut plastic = m.plasticity.is_some();
    ui.checkbox(&mut plastic, "takes plastic set");
    if plastic != m.plasticity.is_some() {
        // Somewhere to begin: what is bent more than around a radius of 5 mm keeps it.
        m.plasticity = plastic.then_some(Plasticity { yield_curvature: 200.0, yield_twist: 200.0, hardening: 0.0 });
    }
    if let Some(p) = &mut m.plasticity {
        ui.add(decades(&mut p.yield_curvature, 1.0..=1e5, "1/m", false).text("yield in bending"));
        ui.add(decades(&mut p.yield_twist, 1.0..=1e5, "rad/m", false).text("yield in twist"));
        ui.add(slider(&mut p.hardening, 0.0..=0.99).text("hardening"));
    }
    ui.horizontal(|ui| {
        ui.selectable_value(stretch, Stretch::Elastic, "elastic");
        ui.selectable_value(stretch, Stretch::Inextensible, "inextensible");
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ViewerPlugin;
    use crate::control::open;
    use bevy::input::InputPlugin;
    use bevy::window::FileDragAndDrop;
    use bevy_egui::egui::{Context, Event, Modifiers, PointerButton, Pos2, RawInput, Rect, vec2};
    use sutura_bevy::PhysicsClock;

    /// One picture of a panel of 300 by 1200 points, as the pointer does something.
    fn picture(context: &Context, events: Vec<Event>, mut contents: impl FnMut(&mut Ui)) {
        let screen_rect = Some(Rect::from_min_size(Pos2::ZERO, vec2(300.0, 1200.0)));
        context
            .run_ui(RawInput { screen_rect, events, ..RawInput::default() }, |ui| contents(ui))
            .textures_delta
            .clear();
    }

    /// A click at a place: the pointer comes, presses and lets go.
    fn click(context: &Context, at: Pos2, mut contents: impl FnMut(&mut Ui)) {
        let button = |pressed| Event::PointerButton {
            pos: at,
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::default(),
        };
        for events in [vec![Event::PointerMoved(at)], vec![button(true)], vec![button(false)], vec![Event::PointerGone]]
        {
            picture(context, events, &mut contents);
        }
    }

    fn app(scene: &str) -> App {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, InputPlugin, ViewerPlugin));
        app.add_message::<FileDragAndDrop>();
        app.world_mut().resource_mut::<PhysicsClock>().running = false;
        open(app.world_mut(), scene);
        app.update();
        app
    }

    #[test]
    fn numbers_read_as_one_writes_them() {
        for (value, unit, prefixed, text) in [
            (2e9, "Pa", true, "2 GPa"),
            (0.35e9, "Pa", true, "350 MPa"),
            (1.234_56e6, "Pa", true, "1.235 MPa"),
            (1.0 / 240.0, "s", true, "4.167 ms"),
            (0.0, "s", true, "0 s"),
            (1150.0, "kg/m³", false, "1150 kg/m³"),
            (0.05, "", false, "0.05"),
            (1e-5, "", false, "0.00001"),
            (12_345.0, "1/m", false, "12345 1/m"),
        ] {
            let found = readable(value, unit, prefixed);
            assert_eq!(found, text);
            if !unit.is_empty() {
                let back = sutura_scene::in_si(&found, unit).unwrap();
                assert!((back - value).abs() <= 1e-3 * value, "{found}: {back}");
            }
        }
    }

    /// What lies beyond the ends of a slider, and what has more digits than it shows, stays.
    #[test]
    fn looking_at_a_panel_changes_nothing() {
        let set = Plasticity { yield_curvature: 0.123_456_789, yield_twist: 1e7, hardening: 0.999 };
        let mut material = Material {
            bend_scale: 1.0 / 3.0,
            bend_damping: 77.7,
            plasticity: Some(set),
            ..Material::elastic(12.345_678_9, 1e5)
        };
        let numbers = PaperSettings { iterations: 5000, frame_inertia: 1e-4, ..PaperSettings::default() };
        let wild = Settings {
            newton_max: 300,
            substep: 1.0 / 7e6,
            linear_damping: 0.999_999,
            tolerance: 1e-9,
            ..Settings::default()
        };
        let context = Context::default();
        for (shear, solver) in [(Shear::Poisson(-0.97), Solver::Direct), (Shear::Modulus(1.0), Solver::Paper(numbers))]
        {
            material.shear = shear;
            let settings = Settings { solver, ..wild.clone() };
            let friction = Friction { stick: 7.0, slide: 6.0 };
            let mut now = (material.clone(), Stretch::Elastic, settings.clone(), friction);
            for _ in 0..3 {
                picture(&context, vec![], |ui| {
                    material_ui(ui, &mut now.0, &mut now.1);
                    settings_ui(ui, &mut now.2, &mut PaperSettings::default());
                    friction_ui(ui, &mut now.3);
                });
            }
            assert_eq!(now, (material.clone(), Stretch::Elastic, settings, friction));
        }
        for sample in sutura_scene::samples() {
            let mut app = app(sample.name);
            let done = |app: &App| app.world().resource::<Sutura>().recording().map(|r| r.inputs.len());
            let before = done(&app);
            for _ in 0..3 {
                picture(&context, vec![], |ui| show(ui, app.world_mut()));
                app.update();
            }
            let parameters = app.world().resource::<Parameters>();
            assert!(
                parameters.wanted.is_empty() && parameters.changed(app.world().resource::<Sutura>().world()).is_empty(),
                "{}",
                sample.name
            );
            assert!(before.is_some() && done(&app) == before, "{}", sample.name);
        }
    }

    #[test]
    fn a_slider_that_is_clicked_changes_the_world_and_the_button_puts_it_back() {
        let mut app = app("catenary");
        let context = Context::default();
        let rod = app.world().resource::<Sutura>().simulation::<Play>().unwrap().0.threads().next().unwrap().1;
        let modulus = |app: &App| app.world().resource::<Sutura>().world().rod(rod).unwrap().material().young_modulus;
        let before = modulus(&app);
        // Up the middle of the sliders, until one of them is that of the modulus; above it headings would fold what is
        // below.
        let place = |app: &mut App, is: &dyn Fn(&[Change]) -> bool, x: f32| {
            (2..300).rev().map(|k| Pos2::new(x, 4.0 * k as f32)).find(|at| {
                click(&context, *at, |ui| show(ui, app.world_mut()));
                is(&std::mem::take(&mut app.world_mut().resource_mut::<Parameters>().wanted))
            })
        };
        let of_modulus =
            |c: &[Change]| matches!(c, [.., Change::Material(r, m)] if *r == rod && m.young_modulus != before);
        let at = place(&mut app, &of_modulus, 60.0).expect("there is a slider of the modulus");
        click(&context, at, |ui| show(ui, app.world_mut()));
        app.update();
        let now = modulus(&app);
        // The middle of 0.1 MPa to 1 TPa, roughly.
        assert!(now != before && now > 3e7 && now < 3e9, "{now}");
        assert_eq!(app.world().resource::<Parameters>().changed(app.world().resource::<Sutura>().world()).len(), 1);
        click(&context, Pos2::new(40.0, 12.0), |ui| show(ui, app.world_mut()));
        app.update();
        assert_eq!(modulus(&app), before);
        assert!(app.world().resource::<Parameters>().changed(app.world().resource::<Sutura>().world()).is_empty());
    }
}
