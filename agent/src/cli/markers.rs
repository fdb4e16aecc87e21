//! `skein-agent markers`: prints sheets of markers, and looks for markers in a photograph.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, bail};
use clap::{Args, Subcommand};
use nalgebra::Isometry3;
use serde_json::{Value, json};
use skein_positioning::markers::sheet::{Paper, pages, to_pdf};
use skein_positioning::markers::{
    Camera, Detection, Dictionary, Grey, Layout, Sighting, Solution, Solver, detect,
};

/// The arguments of `skein-agent markers`.
#[derive(Subcommand)]
pub enum Markers {
    /// Write the sheets of a layout (PDF, SVG) to print at 100 %, and its table (layout.toml).
    Print(Print),
    /// Tell the markers in a photograph and, with a layout and a calibration, where the camera was.
    Look(Look),
}

#[derive(Args)]
pub struct Print {
    /// Folder for markers.pdf, markers-1.svg ... and layout.toml; made if missing.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Layout to print: a dictionary, [[floor]] and [[marker]] tables; see docs/positioning.md.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["dictionary", "floor", "side_m", "pitch_m", "first_id"])]
    layout: Option<PathBuf>,
    /// Dictionary of a regular floor: original, 4x4_50 ... 7x7_1000, or OpenCV's name for it.
    #[arg(long, value_name = "NAME", default_value = "original")]
    dictionary: String,
    /// Columns and rows of a regular floor.
    #[arg(long, value_name = "CxR", required_unless_present = "layout")]
    floor: Option<String>,
    /// Side of a marker's black square, m.
    #[arg(long, value_name = "M", default_value_t = 0.18)]
    side_m: f64,
    /// From one marker's centre to the next, m.
    #[arg(long, value_name = "M", default_value_t = 0.36)]
    pitch_m: f64,
    /// Id of the floor's first marker, at the origin; ids rise along the rows, to the east.
    #[arg(long, value_name = "ID", default_value_t = 0)]
    first_id: u32,
    /// Paper: a4, a3, a2, a1, a0, letter, or WIDTHxHEIGHT in mm [default: the smallest, a4 to a0].
    #[arg(long, value_name = "PAPER")]
    paper: Option<Paper>,
}

#[derive(Args)]
pub struct Look {
    /// Photograph: PNG, JPEG or BMP.
    image: PathBuf,
    /// Dictionary to look for, if no layout names it.
    #[arg(long, value_name = "NAME", conflicts_with = "layout")]
    dictionary: Option<String>,
    /// Layout that says where the markers are.
    #[arg(long, value_name = "FILE")]
    layout: Option<PathBuf>,
    /// The camera's calibration, YAML as OpenCV or ROS write it.
    #[arg(long, value_name = "FILE", requires = "layout")]
    camera: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Markers {
    /// Does it. A photograph in which no marker is found gives exit code 1.
    ///
    /// # Errors
    /// A file that cannot be read or written, or does not hold what was expected.
    pub fn run(&self) -> anyhow::Result<ExitCode> {
        match self {
            Self::Print(print) => print.run().map(|()| ExitCode::SUCCESS),
            Self::Look(look) => look.run().map(|any| if any { ExitCode::SUCCESS } else { ExitCode::FAILURE }),
        }
    }
}

impl Print {
    fn run(&self) -> anyhow::Result<()> {
        let layout = match &self.layout {
            Some(path) => read_layout(path)?,
            None => self.floor()?,
        };
        let paper = self.paper.unwrap_or_else(|| Paper::for_layout(&layout));
        let pages = pages(&layout, paper)?;
        std::fs::create_dir_all(&self.out)
            .with_context(|| format!("{}: cannot be made", self.out.display()))?;
        self.write("layout.toml", layout.to_toml().as_bytes())?;
        self.write("markers.pdf", &to_pdf(&pages))?;
        for (number, page) in (1..).zip(&pages) {
            self.write(&format!("markers-{number}.svg"), page.to_svg().as_bytes())?;
        }
        let (markers, sheets) = (layout.markers().count(), pages.len());
        println!(
            "{markers} markers on {sheets} sheets of {paper}: {}",
            self.out.join("markers.pdf").display()
        );
        println!("Print at 100 % (no fitting to the page), and measure the line at the foot.");
        println!("Their places stand in {}.", self.out.join("layout.toml").display());
        Ok(())
    }

    fn floor(&self) -> anyhow::Result<Layout> {
        let floor = self.floor.as_deref().unwrap_or_default();
        let sides =
            floor.split_once('x').map(|(columns, rows)| (columns.parse::<u32>(), rows.parse::<u32>()));
        let Some((Ok(columns), Ok(rows))) = sides else {
            bail!("--floor `{floor}`: expected columns and rows, such as 10x10");
        };
        let Self { dictionary, side_m, pitch_m, first_id, .. } = self;
        let table = toml::Table::from_iter([
            ("dictionary".to_owned(), toml::Value::from(dictionary.as_str())),
            (
                "floor".to_owned(),
                toml::Value::from(vec![toml::Table::from_iter([
                    ("first_id".to_owned(), toml::Value::from(*first_id)),
                    ("columns".to_owned(), columns.into()),
                    ("rows".to_owned(), rows.into()),
                    ("side_m".to_owned(), (*side_m).into()),
                    ("pitch_m".to_owned(), (*pitch_m).into()),
                ])]),
            ),
        ]);
        table.try_into().map_err(|error: toml::de::Error| anyhow::anyhow!("{}", error.message()))
    }

    fn write(&self, name: &str, content: &[u8]) -> anyhow::Result<()> {
        let path = self.out.join(name);
        std::fs::write(&path, content).with_context(|| format!("{}: cannot be written", path.display()))
    }
}

fn read(path: &Path) -> anyhow::Result<String> {
    std::fs::read_to_string(path).with_context(|| format!("{}: cannot be read", path.display()))
}

fn read_layout(path: &Path) -> anyhow::Result<Layout> {
    toml::from_str(&read(path)?).with_context(|| format!("{}: it is no layout", path.display()))
}

impl Look {
    /// Whether any marker was found.
    fn run(&self) -> anyhow::Result<bool> {
        let image = image::open(&self.image)
            .with_context(|| format!("{}: it is no image that can be read", self.image.display()))?
            .into_luma8();
        let (width, height) = (image.width() as usize, image.height() as usize);
        let grey = Grey::new(image.as_raw(), width, height)?;
        let layout = self.layout.as_deref().map(read_layout).transpose()?;
        let dictionary = match (&layout, &self.dictionary) {
            (Some(layout), _) => layout.dictionary().clone(),
            (None, name) => Dictionary::named(name.as_deref().unwrap_or("original"))?,
        };
        let found = detect(&grey, &dictionary);
        let camera = self.camera.as_deref().map(|path| read_camera(path, [width, height])).transpose()?;
        let sighting = match (layout, camera) {
            (Some(layout), Some(camera)) => {
                Some(Solver::new(camera, Isometry3::identity()).solve(&layout, &found))
            }
            _ => None,
        };
        if self.json {
            println!("{}", as_json(dictionary.name(), &found, sighting.as_ref()));
        } else {
            tell(dictionary.name(), &found, sighting.as_ref());
        }
        Ok(!found.is_empty())
    }
}

/// A calibration counts for the image size that it was made at.
fn read_camera(path: &Path, image: [usize; 2]) -> anyhow::Result<Camera> {
    let camera = Camera::from_calibration(&read(path)?)
        .with_context(|| format!("{}: it is no calibration", path.display()))?;
    let calibrated = [camera.width(), camera.height()];
    if calibrated != image {
        bail!(
            "{}: it was made for images of {} x {} pixels, and this one has {} x {}",
            path.display(),
            calibrated[0],
            calibrated[1],
            image[0],
            image[1]
        );
    }
    Ok(camera)
}

/// The standard deviations of a position, east, north and up, m.
fn sigma_m(solution: &Solution) -> [f64; 3] {
    [0, 1, 2].map(|axis| solution.covariance[(axis, axis)].sqrt())
}

fn as_json(dictionary: &str, found: &[Detection], sighting: Option<&Option<Sighting>>) -> Value {
    let markers: Vec<_> = found
        .iter()
        .map(|seen| {
            let corners = seen.corners.map(|corner| [corner.x, corner.y]);
            json!({ "id": seen.id, "errors": seen.errors, "corners_px": corners })
        })
        .collect();
    let camera = sighting.map(|sighting| {
        sighting.as_ref().map(|sighting| {
            let pose = &sighting.best.body_to_world;
            let [i, j, k, w] = pose.rotation.coords.into();
            let position: [f64; 3] = pose.translation.vector.into();
            let sigma_m = sigma_m(&sighting.best);
            json!({
                "position_m": position,
                "orientation_wxyz": [w, i, j, k],
                "sigma_m": sigma_m,
                "rms_px": sighting.best.rms_px,
                "ambiguous": sighting.is_ambiguous,
                "used": sighting.used,
                "rejected": sighting.rejected,
            })
        })
    });
    json!({ "dictionary": dictionary, "markers": markers, "camera": camera.flatten() })
}

fn tell(dictionary: &str, found: &[Detection], sighting: Option<&Option<Sighting>>) {
    println!("{} markers of `{dictionary}`", found.len());
    for seen in found {
        let corners = seen.corners.map(|corner| format!("({:.1}, {:.1})", corner.x, corner.y)).join(" ");
        println!("{:>6}  {corners}", seen.id);
    }
    match sighting {
        None => {}
        Some(None) => {
            println!("They do not tell where the camera was: too few of the layout, or not where it says.")
        }
        Some(Some(sighting)) => {
            let best = &sighting.best;
            let place = best.body_to_world.translation.vector;
            let [east, north, up] = sigma_m(best);
            println!(
                "The camera was at {:.3} east, {:.3} north, {:.3} up, m, to {east:.3}, {north:.3}, {up:.3} m (sigma);",
                place.x, place.y, place.z
            );
            println!("corners agree to {:.2} px (RMS) over {} markers.", best.rms_px, sighting.used.len());
            if sighting.is_ambiguous {
                println!(
                    "Another pose explains the image as well: more markers, or a steeper look, would tell."
                );
            }
            if !sighting.rejected.is_empty() {
                println!("Not where the layout says, or misread: {:?}", sighting.rejected);
            }
        }
    }
}
