//! A picture for print: lines in several styles, bands, marks, a legend where the author wants it.

use super::draw::{FONT, axes_text, provide_font};
use super::png;
use crate::error::{Error, Result};
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use std::ops::Range;
use std::path::Path;

/// Colours that stay distinct for colour-blind readers (Okabe and Ito, Color Universal Design, 2008).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "colours are what they are called")]
pub enum Ink {
    Black,
    Grey,
    Red,
    Orange,
    Green,
    Blue,
    Sky,
    Purple,
    Brown,
}

impl Ink {
    fn colour(self) -> RGBColor {
        match self {
            Self::Black => RGBColor(0, 0, 0),
            Self::Grey => RGBColor(130, 130, 130),
            Self::Red => RGBColor(213, 40, 0),
            Self::Orange => RGBColor(230, 159, 0),
            Self::Green => RGBColor(0, 158, 115),
            Self::Blue => RGBColor(0, 114, 178),
            Self::Sky => RGBColor(86, 180, 233),
            Self::Purple => RGBColor(190, 100, 160),
            Self::Brown => RGBColor(150, 110, 60),
        }
    }
}

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// A line without gaps.
    Solid,
    /// Long dashes.
    Dashed,
    /// Short dashes.
    Dotted,
    /// A circle at each point, no line.
    Marks,
}

/// One named set of points.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Name in the legend; empty: not listed.
    pub label: String,
    /// Points in the order of the line.
    pub points: Vec<(f64, f64)>,
    /// A band around the line: x, lower and upper y.
    pub band: Vec<(f64, f64, f64)>,
    /// Colour.
    pub ink: Ink,
    /// Line or marks.
    pub style: Style,
}

impl Series {
    /// A series without a band.
    #[must_use]
    pub fn new(label: impl Into<String>, ink: Ink, style: Style, points: Vec<(f64, f64)>) -> Self {
        Self { label: label.into(), points, band: Vec::new(), ink, style }
    }
}

/// Where the legend stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "corners are what they are called")]
pub enum Corner {
    UpperLeft,
    UpperRight,
    LowerRight,
    MiddleRight,
}

/// One picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Title above the axes.
    pub title: String,
    /// Label of the x axis, with its unit.
    pub x_label: String,
    /// Label of the y axis, with its unit.
    pub y_label: String,
    /// Range of the x axis.
    pub x: [f64; 2],
    /// Range of the y axis.
    pub y: [f64; 2],
    /// Corner of the legend.
    pub legend: Corner,
    /// Curves; later ones on top.
    pub series: Vec<Series>,
}

const SIZE: (u32, u32) = (860, 600);
/// Pixels of a PNG per unit of [`SIZE`]: lines have whole-pixel corners, which show at one.
const PNG_SCALE: u32 = 2;

type Chart<'a, B> = ChartContext<'a, B, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
type Drawn = std::result::Result<(), String>;

/// Draw `panel` into `path`, SVG or PNG by its ending.
///
/// # Errors
/// [`Error::File`] when an axis has no length, the ending is neither `svg` nor `png`, or the file cannot be
/// written.
pub fn draw_panel(path: &Path, panel: &Panel) -> Result<()> {
    let fault = |message: String| Error::File { path: path.to_path_buf(), message };
    provide_font().map_err(|()| fault("the embedded font cannot be read".to_owned()))?;
    if ![panel.x, panel.y].iter().all(|[low, high]| high > low && high.is_finite() && low.is_finite()) {
        return Err(fault(format!("no axes to draw: x {:?}, y {:?}", panel.x, panel.y)));
    }
    let drawn = match path.extension().and_then(|ending| ending.to_str()) {
        Some("svg") => page(SVGBackend::new(path, SIZE).into_drawing_area(), 1, panel),
        Some("png") => {
            let size = (SIZE.0 * PNG_SCALE, SIZE.1 * PNG_SCALE);
            let mut pixels = vec![0; (size.0 * size.1 * 3) as usize];
            page(BitMapBackend::with_buffer(&mut pixels, size).into_drawing_area(), PNG_SCALE, panel)
                .map(|()| png::write(path, &pixels, size))
                .and_then(|written| written.map_err(|error| error.to_string()))
        }
        _ => Err("pictures end in .svg or .png".to_owned()),
    };
    drawn.map_err(|reason| fault(format!("cannot draw the picture: {reason}")))
}

fn page<B: DrawingBackend>(area: DrawingArea<B, Shift>, scale: u32, panel: &Panel) -> Drawn {
    let text = |error: DrawingAreaErrorKind<B::ErrorType>| error.to_string();
    let size = |units: u32| units * scale;
    area.fill(&WHITE).map_err(text)?;
    let mut chart: Chart<'_, B> = ChartBuilder::on(&area)
        .caption(&panel.title, (FONT, size(22)))
        .margin(size(14))
        .margin_right(size(28))
        .x_label_area_size(size(52))
        .y_label_area_size(size(78))
        .build_cartesian_2d(panel.x[0]..panel.x[1], panel.y[0]..panel.y[1])
        .map_err(text)?;
    let [x_tick, y_tick] = [panel.x, panel.y].map(axes_text);
    chart
        .configure_mesh()
        .x_desc(&panel.x_label)
        .y_desc(&panel.y_label)
        .x_labels(9)
        .y_labels(8)
        .x_label_formatter(&|value| x_tick(*value))
        .y_label_formatter(&|value| y_tick(*value))
        .label_style((FONT, size(17)))
        .axis_desc_style((FONT, size(20)))
        .bold_line_style(RGBColor(225, 225, 225))
        .light_line_style(WHITE)
        .draw()
        .map_err(text)?;
    for series in &panel.series {
        band::<B>(&mut chart, series)?;
    }
    for series in &panel.series {
        line::<B>(&mut chart, series, scale)?;
    }
    let corner = match panel.legend {
        Corner::UpperLeft => SeriesLabelPosition::UpperLeft,
        Corner::UpperRight => SeriesLabelPosition::UpperRight,
        Corner::LowerRight => SeriesLabelPosition::LowerRight,
        Corner::MiddleRight => SeriesLabelPosition::MiddleRight,
    };
    chart
        .configure_series_labels()
        .position(corner)
        .label_font((FONT, size(16)))
        .legend_area_size(size(46))
        .margin(size(10))
        .background_style(WHITE.mix(0.85))
        .border_style(RGBColor(180, 180, 180))
        .draw()
        .map_err(text)?;
    area.present().map_err(text)
}

fn band<B: DrawingBackend>(chart: &mut Chart<'_, B>, series: &Series) -> Drawn {
    if series.band.len() < 2 {
        return Ok(());
    }
    let (x, y) = (chart.x_range(), chart.y_range());
    let inside = |&&(at, low, _): &&(f64, f64, f64)| within(at, &x) && within(low, &y);
    let band: Vec<&(f64, f64, f64)> = series.band.iter().filter(inside).collect();
    let upper = band.iter().map(|(at, _, high)| (*at, high.min(y.end)));
    let outline: Vec<(f64, f64)> = upper.chain(band.iter().rev().map(|(at, low, _)| (*at, *low))).collect();
    let shade = Polygon::new(outline, series.ink.colour().mix(0.16));
    chart.draw_series(std::iter::once(shade)).map_err(|error| error.to_string())?;
    Ok(())
}

fn line<B: DrawingBackend>(chart: &mut Chart<'_, B>, series: &Series, scale: u32) -> Drawn {
    let text = |error: DrawingAreaErrorKind<B::ErrorType>| error.to_string();
    let points = thinned(series, chart.x_range(), chart.y_range());
    let colour = series.ink.colour();
    let pen = colour.stroke_width(2 * scale);
    let unit = scale as i32;
    let (dash, gap) = if series.style == Style::Dotted { (3 * unit, 4 * unit) } else { (10 * unit, 6 * unit) };
    let length = 38 * unit;
    let listed = (!series.label.is_empty()).then_some(series.label.as_str());
    match series.style {
        Style::Solid => {
            let drawn = chart.draw_series(LineSeries::new(points, pen)).map_err(text)?;
            if let Some(label) = listed {
                drawn.label(label).legend(move |(x, y)| PathElement::new(vec![(x, y), (x + length, y)], pen));
            }
        }
        Style::Dashed | Style::Dotted => {
            let drawn = chart.draw_series(DashedLineSeries::new(points, dash, gap, pen)).map_err(text)?;
            if let Some(label) = listed {
                drawn
                    .label(label)
                    .legend(move |(x, y)| DashedPathElement::new([(x, y), (x + length, y)], dash, gap, pen));
            }
        }
        Style::Marks => {
            let circle = move |point: (f64, f64)| Circle::new(point, 4 * unit, pen);
            let drawn = chart.draw_series(points.into_iter().map(circle)).map_err(text)?;
            if let Some(label) = listed {
                drawn.label(label).legend(move |(x, y)| Circle::new((x + length / 2, y), 4 * unit, pen));
            }
        }
    }
    Ok(())
}

/// Whether a value lies on an axis; NaN does not.
fn within(value: f64, range: &Range<f64>) -> bool {
    let hair = 1e-6 * (range.end - range.start);
    value >= range.start - hair && value <= range.end + hair
}

/// The points on the axes, without those that lie closer than a hair to the last one kept: dashes come out even.
fn thinned(series: &Series, x: Range<f64>, y: Range<f64>) -> Vec<(f64, f64)> {
    const HAIR: f64 = 0.008;
    let mut kept: Vec<(f64, f64)> = Vec::new();
    // Clamped to the edge, a point would be drawn where the curve is not.
    let inside = |&(px, py): &(f64, f64)| within(px, &x) && within(py, &y);
    let finite = series.points.iter().copied().filter(inside);
    let mut left_out = None;
    for point in finite {
        let far = |last: &(f64, f64)| {
            let [dx, dy] = [(point.0 - last.0) / (x.end - x.start), (point.1 - last.1) / (y.end - y.start)];
            dx * dx + dy * dy > HAIR * HAIR
        };
        if kept.last().is_none_or(far) {
            kept.push(point);
            left_out = None;
        } else {
            left_out = Some(point);
        }
    }
    kept.extend(left_out);
    kept
}
