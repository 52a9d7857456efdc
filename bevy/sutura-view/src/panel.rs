//! Panels: what is shown, how it runs, and what can be changed.

use crate::control::{Typing, Viewer, go_to};
use crate::keys::{Action, KEYS, OTHERS};
use crate::parameters;
use crate::source::Play;
use crate::stage::{Prop, Stage};
use bevy::prelude::*;
use bevy_egui::egui::{self, Color32, RichText, Ui};
use bevy_egui::{EguiContext, PrimaryEguiContext};
use std::collections::VecDeque;
use sutura_bevy::sutura::Hold;
use sutura_bevy::sutura::knot::{Ends, recognize};
use sutura_bevy::{Grip, Hand, Held, PhysicsClock, Pointer, PointerCamera, Space, Strand, Sutura};
use sutura_scene::samples;

/// Curves of the last seconds.
#[derive(Resource, Debug, Default)]
pub struct Curves {
    tension: VecDeque<f64>,
    force: VecDeque<f64>,
    ms: VecDeque<f64>,
    frames: u64,
}

/// Points of a curve: ten seconds at 60 a second.
const POINTS: usize = 600;

/// Takes down what the curves show.
pub fn measure(
    mut curves: ResMut<Curves>,
    clock: Res<PhysicsClock>,
    sutura: Res<Sutura>,
    hand: Res<Hand>,
    grips: Query<&Grip>,
) {
    if clock.frames == curves.frames {
        return;
    }
    if clock.frames < curves.frames {
        *curves = Curves::default();
    }
    curves.frames = clock.frames;
    let tension = sutura.world().view().rods().map(|r| r.max_tension()).fold(0.0, f64::max);
    let force = grips.iter().map(Grip::force).fold(hand.force.length(), f64::max);
    for (curve, value) in [(0, tension), (1, force), (2, clock.ms)] {
        let Curves { tension, force, ms, .. } = &mut *curves;
        let curve = [tension, force, ms].into_iter().nth(curve);
        if let Some(curve) = curve {
            if curve.len() == POINTS {
                curve.pop_front();
            }
            curve.push_back(value);
        }
    }
}

/// The knot of each thread, recognized a few times a second.
#[derive(Resource, Debug, Default)]
pub struct Knots {
    names: Vec<String>,
    at: f64,
}

/// Recognizes them.
pub fn recognize_knots(
    mut knots: ResMut<Knots>,
    viewer: Res<Viewer>,
    time: Res<Time<Real>>,
    sutura: Res<Sutura>,
    strands: Query<(&Prop, &Strand)>,
    stage: Res<Stage>,
) {
    if !viewer.knot || time.elapsed_secs_f64() < knots.at + 0.4 {
        return;
    }
    knots.at = time.elapsed_secs_f64();
    let live = stage.past.is_none().then(|| sutura.simulation::<Play>()).flatten();
    let mut found: Vec<(usize, String)> = strands
        .iter()
        .map(|(prop, strand)| {
            // In a scene that is played it is known which ends are held.
            let name = match live {
                Some(play) => play.0.knot(prop.0).knot,
                None if strand.positions.len() < 3 => return (prop.0, String::new()),
                None => {
                    recognize(&strand.positions, if strand.skin.seam.is_some() { Ends::Closed } else { Ends::Free }, 1)
                        .to_string()
                }
            };
            (prop.0, name)
        })
        .collect();
    found.sort();
    knots.names = found.into_iter().map(|(_, name)| name).collect();
}

/// All panels.
pub fn show(world: &mut World) {
    let mut contexts = world.query_filtered::<&mut EguiContext, With<PrimaryEguiContext>>();
    let Some(context) = contexts.iter_mut(world).next().map(|mut c| c.get_mut().clone()) else { return };
    // Where pictures are slow, a click of the mouse spans long ones: it is one all the same.
    context.options_mut(|o| o.input_options.max_click_duration = 5.0);
    labels(world, &context);
    let viewer = world.resource::<Viewer>().clone();
    if viewer.panels {
        // A window of another size has its corners elsewhere: panels that stayed, or were pushed together in a small
        // one, would lie on each other.
        let (key, size) = (egui::Id::new("size of the window"), context.content_rect().size());
        let resized = context.data_mut(|d| d.get_temp::<egui::Vec2>(key).is_some_and(|before| before != size));
        context.data_mut(|d| d.insert_temp(key, size));
        let at = |title: &'static str, x: f32, y: f32| {
            let panel = egui::Window::new(title).default_pos([x, y]);
            if resized { panel.current_pos([x, y]) } else { panel }
        };
        scene_panel(world, &context, at("Scene", 10.0, 10.0));
        parameter_panel(world, &context, at("Parameters", size.x - 290.0, 10.0));
        curve_panel(world, &context, at("Curves", 10.0, size.y - 260.0));
    }
    if viewer.help {
        help(world, &context);
    }
    error_window(world, &context);
    let over = context.is_pointer_over_egui() || context.egui_wants_pointer_input();
    world.resource_mut::<Pointer>().busy = over;
    world.resource_mut::<Typing>().0 = typing(&context);
}

/// Whether the keyboard belongs to a field in which something is typed. What else was clicked, or reached by Tab, would
/// keep the keys from the viewer, and take Space for a click: it lets go of them.
fn typing(context: &egui::Context) -> bool {
    let typing = context.text_edit_focused();
    if !typing {
        context.memory_mut(|m| m.focused().inspect(|id| m.surrender_focus(*id)));
    }
    typing
}

fn scene_panel(world: &mut World, context: &egui::Context, panel: egui::Window<'_>) {
    panel.default_width(250.0).show(context, |ui| {
        let (title, name) = (world.resource::<Stage>().title.clone(), world.resource::<Stage>().name.clone());
        ui.label(RichText::new(title).strong());
        egui::ComboBox::from_id_salt("samples").selected_text(&name).width(220.0).show_ui(ui, |ui| {
            for sample in samples() {
                if ui.selectable_label(name == sample.name, sample.name).on_hover_text(sample.title).clicked() {
                    world.resource_mut::<Viewer>().open = Some(sample.name.into());
                }
            }
        });
        let running = world.resource::<PhysicsClock>().running;
        ui.horizontal(|ui| {
            for (label, action) in [
                ("⏮", Action::First),
                (if running { "⏸" } else { "▶" }, Action::PlayPause),
                ("⏭", Action::Step),
                ("⏺ now", Action::Latest),
                ("↺", Action::Reset),
            ] {
                let key = KEYS.iter().find(|k| k.3 == action).map_or("", |k| k.1);
                if ui.button(label).on_hover_text(key).clicked() {
                    world.resource_mut::<Viewer>().wanted.push(action);
                }
            }
        });
        let stage = world.resource::<Stage>();
        let (first, last) = (stage.frames.first().map_or(0.0, |f| f.time), stage.frames.last().map_or(0.0, |f| f.time));
        let mut time = stage.shown().map_or(last, |f| f.time);
        let old = time;
        ui.spacing_mut().slider_width = 150.0;
        // Decimals by the formatter alone: a slider that is given a number of decimals rounds the time itself, which
        // would count as a wish to go there.
        let slider =
            egui::Slider::new(&mut time, first..=last.max(first + 1e-9)).custom_formatter(|t, _| format!("{t:.2} s"));
        ui.add_enabled(last > first, slider);
        if time != old {
            go_to(world, time);
        }
        let mut clock = world.resource_mut::<PhysicsClock>();
        ui.add(egui::Slider::new(&mut clock.speed, 1.0 / 64.0..=16.0).logarithmic(true).text("speed"));
        let line = format!("{:.1} ms a frame, {:.2} x real time", clock.ms, clock.rate);
        if clock.is_late() {
            ui.colored_label(
                Color32::from_rgb(255, 150, 60),
                format!("{line}\nphysics cannot keep up: {:.1} s given up", clock.lost),
            );
        } else {
            ui.label(line);
        }
        if let Some(play) = world.resource::<Sutura>().simulation::<Play>() {
            let now = play.0.now();
            ui.label(if now.finished {
                "the scene is over, the world goes on".into()
            } else {
                format!("phase {}", now.phase)
            });
            for warning in play.0.warnings() {
                ui.colored_label(Color32::from_rgb(255, 190, 80), &warning.message);
            }
            for incident in play.0.incidents() {
                ui.colored_label(
                    Color32::from_rgb(255, 120, 90),
                    format!("{} ({} times)", incident.message, incident.count),
                );
            }
        }
        ui.separator();
        let stout = world.query::<&Strand>().iter(world).map(|s| s.stoutness).fold(1.0, f64::max);
        let mut viewer = world.resource_mut::<Viewer>();
        ui.horizontal_wrapped(|ui| {
            let v = &mut *viewer;
            for (flag, name) in [
                (&mut v.tension, "tension"),
                (&mut v.frames, "frames"),
                (&mut v.contacts, "contacts"),
                (&mut v.primitives, "primitives"),
                (&mut v.knot, "knot"),
            ] {
                ui.checkbox(flag, name);
            }
        });
        ui.add(egui::Slider::new(&mut viewer.least_width, 0.0..=8.0).text("least width [pixels]"));
        if viewer.tension {
            ui.label(format!("blue 0 N, red {:.3} N", viewer.tension_scale.1));
        }
        if stout > 1.0 {
            ui.label(format!("threads are drawn {stout:.1} times as wide as they are"));
        }
        if !viewer.message.is_empty() {
            ui.label(&viewer.message);
        }
        ui.label(RichText::new("F1: keys").weak());
    });
}

fn parameter_panel(world: &mut World, context: &egui::Context, panel: egui::Window<'_>) {
    let window = panel.default_width(265.0).default_height(context.content_rect().height() - 120.0);
    window.default_open(false).vscroll(true).show(context, |ui| {
        if world.resource::<Stage>().recorded {
            ui.label("A recording: nothing to change.");
            return;
        }
        parameters::show(ui, world);
        ui.collapsing("Hand", |ui| {
            let mut hand = world.resource_mut::<Hand>();
            ui.horizontal(|ui| {
                for (hold, name) in [(Hold::Pin, "pin"), (Hold::Clamp, "clamp"), (Hold::Jaw, "jaw")] {
                    ui.selectable_value(&mut hand.hold, hold, name);
                }
            });
            ui.add(egui::Slider::new(&mut hand.speed_limit, 0.01..=2.0).logarithmic(true).text("speed limit [m/s]"));
            ui.add(egui::Slider::new(&mut hand.force_limit, 0.01..=20.0).logarithmic(true).text("force limit [N]"));
            ui.add(
                egui::Slider::new(&mut world.resource_mut::<Viewer>().grip_speed, 0.001..=0.2)
                    .logarithmic(true)
                    .text("keys [m/s]"),
            );
        });
    });
}

fn curve_panel(world: &mut World, context: &egui::Context, panel: egui::Window<'_>) {
    let curves = world.resource::<Curves>();
    panel.default_width(250.0).default_open(false).show(context, |ui| {
        curve(ui, "greatest tension", "N", &curves.tension, None);
        curve(ui, "force of the hand and grips", "N", &curves.force, None);
        let frame = world.resource::<PhysicsClock>().frame;
        curve(ui, "physics", "ms a frame", &curves.ms, Some(1e3 * frame));
    });
}

/// A curve of the last seconds, with a line at what is wanted.
fn curve(ui: &mut Ui, name: &str, unit: &str, values: &VecDeque<f64>, mark: Option<f64>) {
    let most = values.iter().copied().fold(mark.unwrap_or(0.0), f64::max).max(1e-6);
    ui.label(format!("{name}: {:.3} {unit} (most {most:.3})", values.back().copied().unwrap_or(0.0)));
    let (rect, _) = ui.allocate_exact_size(egui::vec2(240.0, 48.0), egui::Sense::hover());
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, 3.0, Color32::from_black_alpha(120));
    let at = |i: usize, v: f64| {
        egui::pos2(
            rect.left() + rect.width() * i as f32 / POINTS as f32,
            rect.bottom() - 2.0 - (rect.height() - 4.0) * (v / most).clamp(0.0, 1.0) as f32,
        )
    };
    if let Some(mark) = mark {
        painter.line_segment([at(0, mark), at(POINTS, mark)], (1.0, Color32::from_gray(110)));
    }
    let points: Vec<egui::Pos2> = values.iter().enumerate().map(|(i, v)| at(i, *v)).collect();
    painter.line(points, (1.5, Color32::from_rgb(110, 220, 180)));
}

fn help(world: &mut World, context: &egui::Context) {
    let mut open = true;
    egui::Window::new("Keys").open(&mut open).anchor(egui::Align2::CENTER_CENTER, [0.0, 0.0]).resizable(false).show(
        context,
        |ui| {
            egui::ScrollArea::vertical().max_height(0.8 * context.content_rect().height()).show(ui, |ui| {
                egui::Grid::new("keys").num_columns(2).striped(true).show(ui, |ui| {
                    for (key, what) in OTHERS.iter().copied().chain(KEYS.iter().map(|k| (k.1, k.2))) {
                        ui.label(RichText::new(key).strong());
                        ui.label(what);
                        ui.end_row();
                    }
                });
            });
        },
    );
    world.resource_mut::<Viewer>().help = open;
}

fn error_window(world: &mut World, context: &egui::Context) {
    let Some(error) = world.resource::<Stage>().error.clone() else { return };
    let mut open = true;
    egui::Window::new("This cannot be opened").open(&mut open).anchor(egui::Align2::CENTER_CENTER, [0.0, 0.0]).show(
        context,
        |ui| {
            ui.label(RichText::new(error).monospace().color(Color32::from_rgb(255, 150, 120)));
        },
    );
    if !open {
        world.resource_mut::<Stage>().error = None;
    }
}

/// Words in the picture: knots, and the force of what is held.
fn labels(world: &mut World, context: &egui::Context) {
    let painter = context.layer_painter(egui::LayerId::background());
    let screen = context.content_rect();
    if world.resource::<Viewer>().knot {
        let names = &world.resource::<Knots>().names;
        let text = names.iter().filter(|n| !n.is_empty()).cloned().collect::<Vec<_>>().join(", ");
        painter.text(
            screen.center_bottom() - egui::vec2(0.0, 14.0),
            egui::Align2::CENTER_BOTTOM,
            text,
            egui::FontId::proportional(18.0),
            Color32::from_gray(225),
        );
    }
    let mut marks: Vec<(Vec3, f64)> = Vec::new();
    let space = *world.resource::<Space>();
    let hand = world.resource::<Hand>().clone();
    if let Some(Held::Body(_)) = hand.held {
        marks.push((space.place(hand.at), hand.force.length()));
    }
    let mut grips = world.query::<&Grip>();
    marks.extend(
        grips.iter(world).filter(|g| g.handle().is_some()).map(|g| (space.place(g.pose().position), g.force())),
    );
    let mut cameras = world.query_filtered::<(&Camera, &GlobalTransform), With<PointerCamera>>();
    let Ok((camera, place)) = cameras.single(world) else { return };
    for (at, force) in marks {
        if let Ok(p) = camera.world_to_viewport(place, at) {
            painter.text(
                egui::pos2(p.x + 14.0, p.y - 10.0),
                egui::Align2::LEFT_BOTTOM,
                format!("{force:.3} N"),
                egui::FontId::proportional(16.0),
                Color32::from_rgb(255, 220, 120),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy_egui::egui::{Event, Key, Modifiers, PointerButton, RawInput};

    #[test]
    fn keys_belong_to_the_viewer_unless_something_is_typed() {
        let context = egui::Context::default();
        let mut number = 1.0;
        let mut picture = |events: Vec<Event>| {
            let (mut button, mut field) = (egui::Rect::NOTHING, egui::Rect::NOTHING);
            let mut clicks = 0;
            let input = RawInput {
                screen_rect: Some(egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(300.0, 200.0))),
                events,
                ..RawInput::default()
            };
            context
                .run_ui(input, |ui| {
                    let response = ui.button("button");
                    clicks += u32::from(response.clicked());
                    button = response.rect;
                    field = ui.add(egui::DragValue::new(&mut number)).rect;
                })
                .textures_delta
                .clear();
            (button.center(), field.center(), clicks, typing(&context))
        };
        let at = |pos| {
            move |pressed| Event::PointerButton {
                pos,
                button: PointerButton::Primary,
                pressed,
                modifiers: Modifiers::default(),
            }
        };
        let key =
            |key| Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers: Modifiers::default() };
        let (button, field, ..) = picture(vec![]);
        // A button is clicked; Space after that is no click.
        picture(vec![Event::PointerMoved(button)]);
        picture(vec![at(button)(true)]);
        assert_eq!(picture(vec![at(button)(false)]), (button, field, 1, false));
        assert_eq!(picture(vec![key(Key::Space)]), (button, field, 0, false));
        // Tab reaches the button and does not stay there.
        assert!(!picture(vec![key(Key::Tab)]).3);
        assert_eq!(picture(vec![key(Key::Space)]), (button, field, 0, false));
        // A number is clicked and typed.
        picture(vec![Event::PointerMoved(field)]);
        picture(vec![at(field)(true)]);
        assert!(picture(vec![at(field)(false)]).3);
        assert!(picture(vec![Event::Text("7".into())]).3);
        picture(vec![key(Key::Enter)]);
        assert!(!picture(vec![]).3);
        assert_eq!(number, 7.0);
    }
}
