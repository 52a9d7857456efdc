//! The command line.

use clap::Parser;
use std::path::PathBuf;

/// Shows scenes and recorded trajectories of surgical thread.
///
/// In the window: drag threads and bodies with the left mouse button, turn the view with the right one, F1 for the
/// keys.
#[derive(Parser, Debug, Clone, Default)]
#[command(
    version,
    after_help = "\
Examples:
  sutura-view square_knot
  sutura-view out/square_knot/trajectory.sutura
  sutura-view --headless --screenshot out.png --at 2.5 --size 1280x720 capstan"
)]
pub struct Args {
    /// A scene file, a recorded trajectory, or the name of a sample scene.
    #[arg(default_value = "square_knot")]
    pub scene: String,
    /// Draw without a window, for --screenshot or --frames.
    #[arg(long)]
    pub headless: bool,
    /// The picture to write (PNG).
    #[arg(long, value_name = "FILE", requires = "headless")]
    pub screenshot: Option<PathBuf>,
    /// Folder for a sequence of pictures (PNG), from 0 to --at.
    #[arg(long, value_name = "FOLDER", requires = "headless")]
    pub frames: Option<PathBuf>,
    /// Simulated time between the pictures of a sequence, in seconds.
    #[arg(long, default_value_t = 1.0 / 15.0, value_name = "SECONDS")]
    pub every: f64,
    /// Simulated time of the picture in seconds; beyond the end of the scene it is the end.
    #[arg(long, default_value_t = 0.5, value_name = "SECONDS")]
    pub at: f64,
    /// Size of pictures and window in pixels.
    #[arg(long, default_value = "1280x720", value_parser = size, value_name = "WxH")]
    pub size: (u32, u32),
    /// Show the tension as color: the least and the greatest in newton.
    #[arg(long, value_parser = range, value_name = "LOW..HIGH", requires = "headless")]
    pub tension: Option<(f64, f64)>,
    /// Closeness of the view: 2 shows things twice as large.
    #[arg(long, default_value_t = 1.0)]
    pub zoom: f64,
    /// Point in the middle of the view, in meters.
    #[arg(long, value_parser = point, value_name = "X,Y,Z", allow_hyphen_values = true, requires = "headless")]
    pub look_at: Option<[f64; 3]>,
    /// Least width at which a thread is drawn, in pixels; 0 draws it as thin as it is.
    #[arg(long, default_value_t = 3.0, value_name = "PIXELS")]
    pub least_width: f32,
    /// Try the window: whether time goes on with all panels shown, files are written and opened, keys and mouse do what
    /// they should; then close it.
    #[arg(long = "try", conflicts_with = "headless")]
    pub trial: bool,
    /// Begin paused.
    #[arg(long)]
    pub paused: bool,
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let (w, h) = text.split_once('x').ok_or("WIDTHxHEIGHT, such as 1280x720")?;
    let one = |s: &str| s.parse::<u32>().ok().filter(|v| (16..=8192).contains(v)).ok_or("16 to 8192 pixels a side");
    Ok((one(w)?, one(h)?))
}

fn point(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|s| s.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    numbers.and_then(|n| n.try_into().ok()).ok_or("three coordinates in meters, such as 0,0.01,0".into())
}

fn range(text: &str) -> Result<(f64, f64), String> {
    let (a, b) = text.split_once("..").ok_or("LOW..HIGH, such as 0..1.5")?;
    let one = |s: &str| s.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or("a number of newton");
    let (a, b) = (one(a)?, one(b)?);
    if a < b { Ok((a, b)) } else { Err("the greatest after the least".into()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_are_read_and_bad_ones_refused() {
        let of = |words: &str| Args::try_parse_from(words.split(' '));
        let args = of("sutura-view --headless --screenshot out.png --at 2.5 --size 640x480 capstan").unwrap();
        assert_eq!((args.at, args.size, args.scene.as_str()), (2.5, (640, 480), "capstan"));
        assert!(of("sutura-view --size 640").is_err());
        assert!(of("sutura-view --size 0x5").is_err());
        assert!(of("sutura-view --headless --tension 2..1 capstan").is_err());
    }
}
