//! Lines on paper: axes, grid, legend. The font is carried along, so that pictures come out the same
//! on machines without any fonts.

use crate::error::{Error, Result};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::register_font;
use std::path::Path;
use std::sync::OnceLock;

/// A named curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Name in the legend.
    pub label: String,
    /// Points; those that are not finite interrupt the line.
    pub points: Vec<(f64, f64)>,
}

impl Curve {
    /// Some point can be drawn.
    #[must_use]
    pub fn shows(&self) -> bool {
        self.points.iter().any(finite)
    }
}

const SIZE: (u32, u32) = (1200, 800);
/// Pixels of a PNG per unit of [`SIZE`]: lines have whole-pixel corners, which show at one.
const PNG_SCALE: u32 = 2;
/// Points of so short a curve are marked.
const MARKED_POINTS: usize = 16;
pub(super) const FONT: &str = "sans-serif";
/// Distinct also for colour-blind readers (Okabe and Ito, Color Universal Design, 2008).
const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(90, 90, 90),
    RGBColor(150, 110, 60),
];

/// Draw curves into `path`, SVG or PNG by its ending. Labels carry the units, as in `stress / MPa`.
///
/// # Errors
/// [`Error::File`] when there is no finite point, the ending is neither `svg` nor `png`, or the file
/// cannot be written.
pub fn draw_curves(path: &Path, title: &str, x_label: &str, y_label: &str, curves: &[Curve]) -> Result<()> {
    let fault = |message: String| Error::File { path: path.to_path_buf(), message };
    provide_font().map_err(|()| fault("the embedded font cannot be read".to_owned()))?;
    let bounds = Bounds::of(curves).ok_or_else(|| fault("no finite point to draw".to_owned()))?;
    let labels = [title, x_label, y_label];
    let drawn = match path.extension().and_then(|ending| ending.to_str()) {
        Some("svg") => chart(SVGBackend::new(path, SIZE).into_drawing_area(), 1, labels, &bounds, curves),
        Some("png") => {
            let size = (SIZE.0 * PNG_SCALE, SIZE.1 * PNG_SCALE);
            chart(BitMapBackend::new(path, size).into_drawing_area(), PNG_SCALE, labels, &bounds, curves)
        }
        _ => Err("pictures end in .svg or .png".to_owned()),
    };
    drawn.map_err(|reason| fault(format!("cannot draw the picture: {reason}")))
}

/// Make the embedded font known to the drawing library, once.
pub(super) fn provide_font() -> std::result::Result<(), ()> {
    static REGISTERED: OnceLock<std::result::Result<(), ()>> = OnceLock::new();
    *REGISTERED.get_or_init(|| register_font(FONT, FontStyle::Normal, ttf_noto_sans::REGULAR).map_err(|_| ()))
}

/// What the axes show, with a margin around the data.
struct Bounds {
    x: [f64; 2],
    y: [f64; 2],
}

impl Bounds {
    fn of(curves: &[Curve]) -> Option<Self> {
        let mut x = [f64::INFINITY, f64::NEG_INFINITY];
        let mut y = x;
        for &(px, py) in curves.iter().flat_map(|curve| &curve.points).filter(|point| finite(point)) {
            x = [x[0].min(px), x[1].max(px)];
            y = [y[0].min(py), y[1].max(py)];
        }
        (x[0] <= x[1]).then(|| Self { x: widened(x, 0.02), y: widened(y, 0.06) })
    }
}

fn finite(point: &(f64, f64)) -> bool {
    point.0.is_finite() && point.1.is_finite()
}

fn widened([low, high]: [f64; 2], share: f64) -> [f64; 2] {
    let largest = low.abs().max(high.abs());
    // A constant curve gets a band around it, all zeros one around zero.
    let span = if high - low > 1e-12 * largest { high - low } else { largest.max(1.0) };
    [low - share * span, high + share * span]
}

fn chart<B: DrawingBackend>(
    area: DrawingArea<B, Shift>,
    scale: u32,
    [title, x_label, y_label]: [&str; 3],
    bounds: &Bounds,
    curves: &[Curve],
) -> std::result::Result<(), String> {
    let text = |error: DrawingAreaErrorKind<B::ErrorType>| error.to_string();
    let size = |units: u32| units * scale;
    area.fill(&WHITE).map_err(text)?;
    let mut chart = ChartBuilder::on(&area)
        .caption(title, (FONT, size(34)))
        .margin(size(24))
        .margin_right(size(40))
        .x_label_area_size(size(72))
        .y_label_area_size(size(110))
        .build_cartesian_2d(bounds.x[0]..bounds.x[1], bounds.y[0]..bounds.y[1])
        .map_err(text)?;
    let (x_digits, y_digits) = (tick_digits(bounds.x), tick_digits(bounds.y));
    chart
        .configure_mesh()
        .x_desc(x_label)
        .y_desc(y_label)
        .x_labels(9)
        .y_labels(8)
        .x_label_formatter(&|value| tick(*value, x_digits))
        .y_label_formatter(&|value| tick(*value, y_digits))
        .label_style((FONT, size(22)))
        .axis_desc_style((FONT, size(26)))
        .bold_line_style(RGBColor(215, 215, 215))
        .light_line_style(WHITE)
        .draw()
        .map_err(text)?;
    for (index, curve) in curves.iter().enumerate() {
        let colour = COLOURS[index % COLOURS.len()];
        let style = colour.stroke_width(size(3));
        let mut label = Some(curve.label.as_str());
        for run in curve.points.split(|point| !finite(point)).filter(|run| !run.is_empty()) {
            if run.len() <= MARKED_POINTS {
                let dot = |point: &(f64, f64)| Circle::new(*point, size(6), colour.filled());
                chart.draw_series(run.iter().map(dot)).map_err(text)?;
            }
            // Thick polylines of bitmaps have long spikes where a curve turns back; pictures of bitmaps are scaled.
            let series = if scale > 1 && run.len() > 1 {
                let pieces = run.windows(2).map(|ends| PathElement::new(ends.to_vec(), style));
                chart.draw_series(pieces).map_err(text)?
            } else {
                chart.draw_series(LineSeries::new(run.iter().copied(), style)).map_err(text)?
            };
            if let Some(label) = label.take() {
                let length = size(34) as i32;
                series.label(label).legend(move |(x, y)| PathElement::new(vec![(x, y), (x + length, y)], style));
            }
        }
    }
    chart
        .configure_series_labels()
        .position(legend_position(bounds, curves))
        .label_font((FONT, size(22)))
        .legend_area_size(size(44))
        .margin(size(16))
        .background_style(WHITE.mix(0.85))
        .border_style(RGBColor(180, 180, 180))
        .draw()
        .map_err(text)?;
    area.present().map_err(text)
}

/// The corner that the curves leave freest.
fn legend_position(bounds: &Bounds, curves: &[Curve]) -> SeriesLabelPosition {
    let corners = [
        (SeriesLabelPosition::UpperRight, [1.0, 1.0]),
        (SeriesLabelPosition::UpperLeft, [0.0, 1.0]),
        (SeriesLabelPosition::LowerRight, [1.0, 0.0]),
        (SeriesLabelPosition::LowerLeft, [0.0, 0.0]),
    ];
    let relative = |value: f64, [low, high]: [f64; 2]| (value - low) / (high - low);
    let crowd = |corner: [f64; 2]| {
        let points = curves.iter().flat_map(|curve| &curve.points);
        points
            .filter(|(x, y)| {
                let away = [(relative(*x, bounds.x) - corner[0]).abs(), (relative(*y, bounds.y) - corner[1]).abs()];
                away[0] < 0.3 && away[1] < 0.12 + 0.05 * curves.len() as f64
            })
            .count()
    };
    let freest = corners.into_iter().min_by_key(|(_, corner)| crowd(*corner));
    freest.map_or(SeriesLabelPosition::UpperRight, |(position, _)| position)
}

/// Text of a tick on an axis with this range.
pub(super) fn axes_text(range: [f64; 2]) -> impl Fn(f64) -> String {
    let digits = tick_digits(range);
    move |value| tick(value, digits)
}

/// Decimals that tell neighbouring ticks apart.
fn tick_digits([low, high]: [f64; 2]) -> usize {
    let mut step = (high - low) / 10.0;
    let mut digits = 0;
    while step < 1.0 && digits < 8 {
        step *= 10.0;
        digits += 1;
    }
    digits
}

fn tick(value: f64, digits: usize) -> String {
    if value != 0.0 && !(1e-4..1e6).contains(&value.abs()) {
        return format!("{value:.1e}");
    }
    let text = format!("{value:.digits$}");
    // Rounding leaves −0.00 behind.
    if text.parse() == Ok(0.0) { text.trim_start_matches('-').to_owned() } else { text }
}
