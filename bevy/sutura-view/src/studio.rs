//! Pictures without a window: the same scene, drawn into an image and read back.

use crate::camera::{self, FIELD, Orbit, Surroundings};
use crate::source::Play;
use crate::stage::{self, Stage};
use crate::{ViewerPlugin, quiet};
use bevy::asset::RenderAssetUsages;
use bevy::camera::RenderTarget;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages};
use bevy::render::settings::{Backends, WgpuSettings};
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured};
use bevy::window::ExitCondition;
use bevy::winit::WinitPlugin;
use std::path::Path;
use std::sync::{Arc, Mutex};
use sutura_bevy::sutura::glam::DVec3;
use sutura_bevy::sutura::{Geometry, Pose};
use sutura_bevy::{PhysicsClock, Solid, Space, Strand, Sutura, Tip, Triangles};

/// A picture, rows from the top, three bytes a pixel (sRGB).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Red, green, blue.
    pub data: Vec<u8>,
}

impl Picture {
    /// The color of a pixel.
    pub fn at(&self, x: u32, y: u32) -> [u8; 3] {
        let i = 3 * (y * self.width + x) as usize;
        [self.data[i], self.data[i + 1], self.data[i + 2]]
    }
    /// Writes it as PNG.
    pub fn write(&self, path: &Path) -> anyhow::Result<()> {
        let file = std::io::BufWriter::new(std::fs::File::create(path)?);
        let mut encoder = png::Encoder::new(file, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        encoder.write_header()?.write_image_data(&self.data)?;
        Ok(())
    }
    /// Of a picture that is larger by a whole factor: each pixel is the mean of those that it covers.
    fn reduced(data: &[u8], width: u32, height: u32, factor: u32) -> Picture {
        let mut out = Vec::with_capacity((3 * width * height) as usize);
        let row = 4 * (width * factor) as usize;
        for y in 0..height as usize {
            for x in 0..width as usize {
                for c in 0..3 {
                    let f = factor as usize;
                    let sum: u32 =
                        (0..f * f).map(|k| u32::from(data[(y * f + k / f) * row + 4 * (x * f + k % f) + c])).sum();
                    out.push((sum / (factor * factor)) as u8);
                }
            }
        }
        Picture { width, height, data: out }
    }
}

/// Draws scenes.
pub struct Studio {
    app: App,
    target: Handle<Image>,
    size: (u32, u32),
}

/// Pixels drawn for one of the picture, each way: threads are thin.
const FINER: u32 = 2;
/// Pictures that a screenshot may take to come back.
const PATIENCE: u32 = 100;

impl Studio {
    /// A studio for pictures of this size. It wants a Vulkan driver; one in software does.
    pub fn new(size: (u32, u32)) -> Studio {
        // OpenGL looks for a display, and complains where there is none.
        let settings = WgpuSettings { backends: Some(Backends::PRIMARY), ..default() };
        let mut app = App::new();
        app.add_plugins(
            DefaultPlugins
                .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
                // Nothing is drawn before everything is there.
                .set(RenderPlugin {
                    synchronous_pipeline_compilation: true,
                    render_creation: settings.into(),
                    ..default()
                })
                .set(quiet())
                .disable::<WinitPlugin>()
                .disable::<PipelinedRenderingPlugin>(),
        );
        app.add_plugins(ViewerPlugin);
        let extent = Extent3d { width: size.0 * FINER, height: size.1 * FINER, depth_or_array_layers: 1 };
        let mut image = Image::new_uninit(
            extent,
            TextureDimension::D2,
            TextureFormat::Rgba8UnormSrgb,
            RenderAssetUsages::RENDER_WORLD,
        );
        image.texture_descriptor.usage |= TextureUsages::RENDER_ATTACHMENT;
        let target = app.world_mut().resource_mut::<Assets<Image>>().add(image);
        let to = target.clone();
        app.add_systems(PostStartup, move |mut commands: Commands, orbit: Res<Orbit>, around: Res<Surroundings>| {
            commands.spawn((camera::lens(&orbit, &around), RenderTarget::from(to.clone())));
        });
        app.add_systems(Startup, |mut store: ResMut<GizmoConfigStore>| {
            for (_, config, _) in store.iter_mut() {
                config.line.width *= FINER as f32;
            }
        });
        app.world_mut().resource_mut::<PhysicsClock>().running = false;
        app.finish();
        app.cleanup();
        Studio { app, target, size }
    }

    /// Opens a scene file, a recording, or a sample scene.
    pub fn open(&mut self, name: &str) -> Result<(), String> {
        stage::open(self.app.world_mut(), name);
        match self.app.world_mut().resource_mut::<Stage>().error.take() {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }

    /// Goes on to a time \[s\], or the end of what was opened.
    pub fn go(&mut self, time: f64) {
        let world = self.app.world_mut();
        if world.resource::<Stage>().recorded {
            let mut stage = world.resource_mut::<Stage>();
            stage.past = stage.frame_at(time);
        } else if let Some(play) = world.resource_mut::<Sutura>().simulation_mut::<Play>() {
            while play.0.now().time < time - 1e-9 && !play.0.now().finished {
                play.0.step_frame();
            }
            // The last two states are one: nothing moves in a picture.
            world.resource_mut::<PhysicsClock>().frames += 1;
        }
        self.app.update();
    }

    /// Looks at everything as the scene wants it, or closer, or at another point \[m\].
    pub fn frame(&mut self, zoom: f64, at: Option<[f64; 3]>) {
        let aspect = self.size.0 as f32 / self.size.1 as f32;
        let world = self.app.world_mut();
        let mut orbit = stage::frame_view(world, aspect, zoom as f32);
        if let Some(at) = at {
            orbit.target = world.resource::<Space>().place(DVec3::from_array(at));
        }
        world.insert_resource(orbit);
        stage::thicken(world, self.size.1);
    }

    /// Shows the tension as color, blue and red at these \[N\].
    pub fn tension(&mut self, scale: Option<(f64, f64)>) {
        let mut viewer = self.app.world_mut().resource_mut::<crate::control::Viewer>();
        viewer.tension = scale.is_some();
        if let Some(scale) = scale {
            (viewer.tension_scale, viewer.tension_fixed) = (scale, true);
        }
    }

    /// Draws it.
    pub fn draw(&mut self) -> Result<Picture, String> {
        // What was changed is laid out (the table, the lamp) and given to the renderer, then drawn and read back.
        self.app.update();
        let taken: Arc<Mutex<Option<Vec<u8>>>> = Arc::default();
        let slot = taken.clone();
        self.app.world_mut().spawn(Screenshot::image(self.target.clone())).observe(
            move |captured: On<ScreenshotCaptured>| {
                if let Ok(mut slot) = slot.lock() {
                    *slot = captured.image.data.clone();
                }
            },
        );
        for _ in 0..PATIENCE {
            self.app.update();
            // It is on its way: no more are drawn meanwhile.
            self.activate(false);
            if let Some(data) = taken.lock().ok().and_then(|mut t| t.take()) {
                self.activate(true);
                return Ok(Picture::reduced(&data, self.size.0, self.size.1, FINER));
            }
        }
        self.activate(true);
        Err("the picture did not come back from the graphics driver".into())
    }

    /// Whether the camera draws.
    fn activate(&mut self, draws: bool) {
        let world = self.app.world_mut();
        world.query::<&mut Camera>().iter_mut(world).for_each(|mut c| c.is_active = draws);
    }

    /// The particles of each thread as pixels of the picture, and whether a body or an instrument hides them; those
    /// farther outside of the picture than a tenth of its height are left out.
    pub fn threads(&mut self) -> Vec<Vec<(f32, f32, bool)>> {
        let world = self.app.world_mut();
        let (orbit, space) = (world.resource::<Orbit>().clone(), *world.resource::<Space>());
        let eye = space.place_back(orbit.transform().translation);
        let bodies: Vec<(Triangles, Pose)> = world
            .query::<&Solid>()
            .iter(world)
            .filter(|s| !matches!(s.geometry, Geometry::Plane))
            .map(|s| (Triangles::of(&s.geometry, 0.0), s.pose))
            .collect();
        let (w, h) = (self.size.0 as f32, self.size.1 as f32);
        let view = orbit.transform().to_matrix().inverse();
        let clip = Mat4::perspective_infinite_reverse_rh(FIELD, w / h, 0.1) * view;
        let tips: Vec<(Triangles, Pose)> = world
            .query::<(&Tip, &Transform)>()
            .iter(world)
            .map(|(tip, at)| {
                (tip.triangles(), Pose::new(space.place_back(at.translation), space.turn_back(at.rotation)))
            })
            .collect();
        let bodies: Vec<(Triangles, Pose)> = bodies.into_iter().chain(tips).collect();
        let hidden = |p: DVec3, radius: f64| {
            bodies.iter().any(|(t, pose)| {
                let (from, way) = (pose.inverse_transform_point(eye), pose.orientation.conjugate() * (p - eye));
                t.hit(from, way).is_some_and(|t| t < 1.0 - 2.0 * radius / way.length())
            })
        };
        world
            .query::<&Strand>()
            .iter(world)
            .map(|strand| {
                let pixels = strand.positions.iter().map(|p| {
                    let at = clip.project_point3(space.place(*p));
                    (0.5 * (at.x + 1.0) * w, 0.5 * (1.0 - at.y) * h, hidden(*p, strand.skin.radius))
                });
                let edge = 0.1 * h;
                pixels.filter(|(x, y, _)| *x >= -edge && *y >= -edge && *x < w + edge && *y < h + edge).collect()
            })
            .collect()
    }

    /// Threads thinner than this are drawn this wide, in pixels.
    pub fn least_width(&mut self, pixels: f32) {
        self.app.world_mut().resource_mut::<crate::control::Viewer>().least_width = pixels;
    }

    /// Width at which a thread of this radius \[m\] is drawn in the middle of the picture, in pixels.
    pub fn width(&self, radius: f64) -> f32 {
        let (orbit, space) = (self.app.world().resource::<Orbit>(), self.app.world().resource::<Space>());
        let least = self.app.world().resource::<crate::control::Viewer>().least_width;
        orbit.pixels(2.0 * radius as f32 * space.scale, self.size.1).max(1.25 * least)
    }

    /// The world of the app, for tests.
    pub fn world(&mut self) -> &mut World {
        self.app.world_mut()
    }
}
