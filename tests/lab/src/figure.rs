//! A figure fit for a paper: lines and points over two axes, as SVG.

use std::ops::Range;

use plotters::prelude::*;

/// A figure.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Figure {
    /// Title of the horizontal axis, with its unit.
    pub x: String,
    /// Title of the vertical axis, with its unit.
    pub y: String,
    /// A metre is as long on both axes.
    pub is_map: bool,
    /// Drawn in this order.
    pub lines: Vec<Line>,
}

/// A line, or points, of one colour.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Its name in the legend; none if empty.
    pub name: String,
    pub style: Style,
    /// In the axes' units.
    pub points: Vec<(f64, f64)>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// From point to point.
    Solid,
    /// From point to point, thin and grey: what others are compared with.
    Reference,
    /// Each point by itself.
    Points,
    /// The area within, grey: an obstacle.
    Filled,
}

/// Colours told apart by everyone (Okabe and Ito 2008).
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];
const GREY: RGBColor = RGBColor(120, 120, 120);
/// Size on the page, in points.
const SIZE: (u32, u32) = (720, 480);

impl Figure {
    /// Draws it.
    ///
    /// # Errors
    /// The drawing library's error.
    pub fn to_svg(&self) -> anyhow::Result<String> {
        let mut svg = String::new();
        {
            let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
            self.draw(&root).map_err(|error| anyhow::anyhow!("a figure cannot be drawn: {error}"))?;
        }
        Ok(svg)
    }

    fn draw<'a>(
        &self,
        root: &DrawingArea<SVGBackend<'a>, plotters::coord::Shift>,
    ) -> Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>> {
        root.fill(&WHITE)?;
        let (across, up) = self.ranges();
        let mut chart = ChartBuilder::on(root)
            .margin(12)
            .x_label_area_size(44)
            .y_label_area_size(72)
            .build_cartesian_2d(across, up)?;
        chart
            .configure_mesh()
            .x_desc(&self.x)
            .y_desc(&self.y)
            .label_style(("sans-serif", 14))
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.08))
            .draw()?;
        let mut colours = COLOURS.iter().cycle();
        for line in &self.lines {
            let points = line.points.iter().copied();
            let colour = match line.style {
                Style::Reference | Style::Filled => GREY,
                Style::Solid | Style::Points => colours.next().copied().unwrap_or(BLACK),
            };
            let drawn = match line.style {
                Style::Solid => chart.draw_series(LineSeries::new(points, colour.stroke_width(2)))?,
                Style::Reference => chart.draw_series(LineSeries::new(points, colour.stroke_width(1)))?,
                Style::Points => chart.draw_series(points.map(|at| Circle::new(at, 3, colour.filled())))?,
                Style::Filled => {
                    chart.draw_series(std::iter::once(Polygon::new(line.points.clone(), colour.mix(0.4))))?
                }
            };
            if !line.name.is_empty() {
                drawn
                    .label(&line.name)
                    .legend(move |(x, y)| Rectangle::new([(x, y - 2), (x + 16, y + 2)], colour.filled()));
            }
        }
        if self.lines.iter().any(|line| !line.name.is_empty()) {
            chart
                .configure_series_labels()
                .label_font(("sans-serif", 14))
                .background_style(WHITE.mix(0.8))
                .position(SeriesLabelPosition::UpperRight)
                .draw()?;
        }
        root.present()
    }

    /// The span of the axes: all points, with a little room, and of a map as much both ways as its shape asks.
    fn ranges(&self) -> (Range<f64>, Range<f64>) {
        let points = || self.lines.iter().flat_map(|line| &line.points);
        let across = span(points().map(|point| point.0));
        let up = span(points().map(|point| point.1));
        if !self.is_map {
            return (across, up);
        }
        let shape = f64::from(SIZE.0 - 96) / f64::from(SIZE.1 - 68);
        let (wide, high) = (across.end - across.start, up.end - up.start);
        (widen(across, high * shape), widen(up, wide / shape))
    }
}

fn span(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values
        .filter(|value| value.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    if low > high {
        return 0.0..1.0;
    }
    let room = if low == high { 0.5 } else { 0.04 * (high - low) };
    low - room..high + room
}

fn widen(range: Range<f64>, to: f64) -> Range<f64> {
    let more = ((to - (range.end - range.start)) / 2.0).max(0.0);
    range.start - more..range.end + more
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(points: Vec<(f64, f64)>) -> Figure {
        let line = Line { name: "measured".into(), style: Style::Solid, points };
        Figure { x: "time (s)".into(), y: "speed (m/s)".into(), is_map: false, lines: vec![line] }
    }

    #[test]
    fn a_figure_names_its_axes_and_lines() {
        let svg = figure(vec![(0.0, 1.0), (2.0, 3.0)]).to_svg().expect("it can be drawn");
        for text in ["time (s)", "speed (m/s)", "measured", "<polyline"] {
            assert!(svg.contains(text), "{text} is missing");
        }
    }

    #[test]
    fn a_figure_of_nothing_or_of_one_point_is_still_a_figure() {
        for points in [vec![], vec![(1.0, 1.0)], vec![(f64::NAN, 1.0)]] {
            figure(points).to_svg().expect("it can be drawn");
        }
    }

    #[test]
    fn a_map_is_to_scale() {
        let mut map = figure(vec![(0.0, 0.0), (100.0, 10.0)]);
        map.is_map = true;
        let (across, up) = map.ranges();
        let shape = (across.end - across.start) / (up.end - up.start);
        assert!((shape - 624.0 / 412.0).abs() < 1e-9, "{shape}");
    }
}
