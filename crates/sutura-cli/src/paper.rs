//! The command `sutura paper`: runs the experiments of `sutura-paper`, writes the page, tables, plots and pictures.

use crate::args::Paper;
use crate::plot::{Figure, Line, rasterize};
use crate::still::{Camera, Image, Look, Size, Solid, Subject, Tube, render};
use crate::{bench, map, say, table};
use anyhow::{Context as _, bail};
use base64::Engine as _;
use indicatif::{ProgressBar, ProgressStyle};
use pulldown_cmark::{CowStr, Event, Options, Parser, Tag};
use std::path::{Path, PathBuf};
use sutura_paper::{Experiment, Panel, Picture, Plot, Result};

/// Folder of everything but the page, in that of the page.
const FOLDER: &str = "paper";
/// Size of a panel of a picture.
const PANEL: Size = Size { width: 380, height: 300 };
/// Room for the words under a panel.
const WORDS: u32 = 26;

/// Runs the command; false when something asked for was not found.
pub fn paper(args: &Paper) -> anyhow::Result<bool> {
    let experiments = chosen(&args.figures)?;
    if args.list {
        return say(&list(&experiments)).map(|()| true);
    }
    // Before the work, so that a folder that cannot be written is found at once.
    let folder = args.out.join(FOLDER);
    std::fs::create_dir_all(&folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let results = simulate(&experiments, args);
    for r in &results {
        draw(r, &folder)?;
    }
    put(&folder.join("times.json"), &times(&results)?)?;
    let machine = bench::machine();
    let now = jiff::Timestamp::now().to_string();
    let date = now.get(..10).unwrap_or(&now);
    let made = format!("On {date}, {}, {} cores, {} build.", machine.cpu, machine.cores, machine.build);
    let text = sutura_paper::page(&results, &made, &|experiment, file| format!("{FOLDER}/{experiment}_{file}"));
    put(&args.out.join("paper.md"), &text)?;
    put(&args.out.join("paper.html"), &html(&text, &args.out))?;
    let checks = || results.iter().flat_map(|r| r.outcome.checks.iter().map(move |c| (r, c)));
    for (r, c) in checks().filter(|(_, c)| !c.passed) {
        say(&format!("NOT AS ASKED {}: {}: {} (bar {})", r.name, c.what, c.found, c.bar))?;
    }
    let (n, ok) = (checks().count(), checks().filter(|(_, c)| c.passed).count());
    say(&format!("{ok} of {n} things are as asked for. The page is {}", args.out.join("paper.md").display()))?;
    Ok(ok == n)
}

fn chosen(names: &[String]) -> anyhow::Result<Vec<Experiment>> {
    let mut all = sutura_paper::experiments();
    if names.is_empty() || names.iter().any(|n| n == "all") {
        return Ok(all);
    }
    for name in names {
        if !all.iter().any(|e| e.name == name) {
            let known: Vec<&str> = all.iter().map(|e| e.name).collect();
            let hint =
                crate::nearest(name, known.iter().copied()).map_or_else(String::new, |n| format!("; is it `{n}`?"));
            bail!("no experiment is called `{name}`{hint} There are: {}", known.join(", "));
        }
    }
    all.retain(|e| names.iter().any(|n| n == e.name));
    Ok(all)
}

fn list(experiments: &[Experiment]) -> String {
    let mut t = table(&["name", "published figures", "what it is"], &[]);
    for e in experiments {
        t.add_row([e.name, e.figures, e.title]);
    }
    t.to_string()
}

/// Runs under a progress bar.
fn simulate(experiments: &[Experiment], args: &Paper) -> Vec<Result> {
    let jobs = args.jobs.map_or_else(|| std::thread::available_parallelism().map_or(1, usize::from), usize::from);
    let bar = if args.verbose { ProgressBar::hidden() } else { ProgressBar::new(1) };
    // The template is a constant; a default bar would do as well.
    if let Ok(style) = ProgressStyle::with_template("{bar:30.blue/white} {pos} of {len}  {elapsed}  {msg}") {
        bar.set_style(style.progress_chars("━━─"));
    }
    bar.tick();
    let results = sutura_paper::run(experiments, jobs, &|p| {
        bar.set_length(p.total as u64);
        bar.set_message(p.name.clone());
        bar.set_position(p.done as u64);
        if args.verbose {
            eprintln!("{:>4} of {}  {:>7.2} s  {}", p.done, p.total, p.seconds, p.name);
        }
    });
    bar.finish_and_clear();
    results
}

fn put(path: &Path, text: &str) -> anyhow::Result<()> {
    crate::output::put(path, text.as_bytes())
}

/// Tables, plots and pictures of an experiment.
fn draw(r: &Result, folder: &Path) -> anyhow::Result<()> {
    let stem = |name: &str| folder.join(format!("{}_{name}", r.name));
    for t in r.outcome.tables.iter().filter(|t| !t.measured) {
        put(&stem(&t.name).with_extension("csv"), &t.csv())?;
    }
    for p in &r.outcome.plots {
        figure(p).write(&stem(&p.name))?;
    }
    if !r.outcome.grids.is_empty() {
        map::write(&r.outcome.grids, &stem("map"))?;
    }
    for p in &r.outcome.pictures {
        sheet(p)?.write(&stem(&p.name).with_extension("png"))?;
    }
    Ok(())
}

fn figure(p: &Plot) -> Figure {
    Figure {
        title: p.title.clone(),
        x: (p.x.name.clone(), p.x.unit.clone()),
        y: (p.y.name.clone(), p.y.unit.clone()),
        log: p.y.log,
        log_x: p.x.log,
        lines: p.curves.iter().map(|c| Line { name: c.name.clone(), points: c.points.clone(), dots: c.dots }).collect(),
        marks: p.marks.clone(),
        ..Figure::default()
    }
}

/// The panels of a picture beside one another, each with its words under it.
fn sheet(p: &Picture) -> anyhow::Result<Image> {
    let columns = p.columns.max(1);
    let rows = p.panels.len().div_ceil(columns);
    let size = Size { width: PANEL.width * columns as u32, height: (PANEL.height + WORDS) * rows as u32 };
    let mut words = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\"><rect width=\"{w}\" height=\"{h}\" fill=\"#fff\"/><g font-size=\"14\" text-anchor=\"middle\" fill=\"#373c44\" font-family=\"DejaVu Sans\">",
        w = size.width,
        h = size.height
    );
    for (k, panel) in p.panels.iter().enumerate() {
        let (column, row) = ((k % columns) as u32, (k / columns) as u32);
        let (x, y) = (PANEL.width * column + PANEL.width / 2, (PANEL.height + WORDS) * (row + 1) - 8);
        let escaped = panel.label.replace('&', "&amp;").replace('<', "&lt;");
        words.push_str(&format!("<text x=\"{x}\" y=\"{y}\">{escaped}</text>"));
    }
    words.push_str("</g></svg>");
    let mut image = rasterize(&words, (size.width, size.height), 1)?;
    for (k, panel) in p.panels.iter().enumerate() {
        let own = view(panel, PANEL);
        let (left, top) = (PANEL.width * (k % columns) as u32, (PANEL.height + WORDS) * (k / columns) as u32);
        for row in 0..own.size.height {
            let from = 3 * (row * own.size.width) as usize;
            let to = 3 * ((top + row) * image.size.width + left) as usize;
            let n = 3 * own.size.width as usize;
            image.rgb[to..to + n].copy_from_slice(&own.rgb[from..from + n]);
        }
    }
    Ok(image)
}

fn view(panel: &Panel, size: Size) -> Image {
    let subject = Subject {
        tubes: panel.tubes.iter().map(|t| Tube { points: t.points.clone(), radius: t.radius }).collect(),
        solids: panel.solids.iter().map(|s| Solid { geometry: s.geometry.clone(), pose: s.pose }).collect(),
    };
    let points: Vec<_> = panel.tubes.iter().flat_map(|t| t.points.iter().copied()).collect();
    let radius = panel.tubes.iter().map(|t| t.radius).fold(0.0, f64::max).max(1e-4);
    let (at, width) = panel.frame.map_or((None, None), |(at, width)| (Some(at), Some(width)));
    let look = Look { direction: Some(panel.look.0), up: Some(panel.look.1), at, width, orthographic: true };
    render(&subject, &Camera::fit(&look, &points, radius, size), size)
}

/// All that was measured in time, as JSON.
fn times(results: &[Result]) -> anyhow::Result<String> {
    let tables = results.iter().flat_map(|r| {
        r.outcome.tables.iter().filter(|t| t.measured).map(move |t| (format!("{}_{}", r.name, t.name), t))
    });
    let cell = |c: &sutura_paper::Cell| match c {
        sutura_paper::Cell::Word(w) => serde_json::json!(w),
        sutura_paper::Cell::Number(v) => serde_json::json!(v),
    };
    let one = |t: &sutura_paper::Table| serde_json::json!({ "headings": t.headings, "rows": t.rows.iter().map(|r| r.iter().map(cell).collect::<Vec<_>>()).collect::<Vec<_>>() });
    let all: serde_json::Map<String, serde_json::Value> = tables.map(|(name, t)| (name, one(t))).collect();
    Ok(serde_json::to_string_pretty(&all)?)
}

const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;max-width:1100px;margin:2em auto;padding:0 1em;color:#23272e}\
table{border-collapse:collapse;margin:1em 0;font-size:14px;display:block;overflow-x:auto}td,th{border:1px solid #dde1e6;padding:.3em .6em;text-align:left}\
th{background:#f6f7f9}img{max-width:100%;height:auto}code{background:#f2f3f5;padding:0 .2em}";

/// The page in one file: pictures are put in as data.
fn html(markdown: &str, out: &Path) -> String {
    let inline = |event: Event<'_>| match event {
        Event::Start(Tag::Image { link_type, dest_url, title, id }) => {
            let data = data_url(&out.join(&*dest_url)).unwrap_or_else(|| dest_url.into_string());
            Event::Start(Tag::Image {
                link_type,
                dest_url: CowStr::from(data),
                title: title.into_static(),
                id: id.into_static(),
            })
        }
        other => other.into_static(),
    };
    let mut body = String::new();
    pulldown_cmark::html::push_html(&mut body, Parser::new_ext(markdown, Options::ENABLE_TABLES).map(inline));
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>The paper, reproduced</title><style>{STYLE}</style></head><body>\n{body}</body></html>\n"
    )
}

/// A picture as text that stands for it.
fn data_url(path: &PathBuf) -> Option<String> {
    let kind = match path.extension()?.to_str()? {
        "svg" => "image/svg+xml",
        "png" => "image/png",
        _ => return None,
    };
    let bytes = std::fs::read(path).ok()?;
    Some(format!("data:{kind};base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes)))
}
