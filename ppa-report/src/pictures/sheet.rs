//! The frame of a picture: header with the verdict, legend, facts, and remarks below.

use ppa_dataset::findings::Severity;

use super::canvas::{Canvas, Colour, GLYPH, Rect, text_width, wrapped};
use super::palette::{FAINT, GOOD, INK, PAGE, SEVERE, WARNING};

/// Width of every picture, pixels.
pub(super) const WIDTH: u32 = 1600;
/// Smallest height, pixels.
pub(super) const HEIGHT: u32 = 1000;
pub(super) const GAP: u32 = 8;
pub(super) const HEADER: u32 = 76;
/// End of the panels and start of the remarks, pixels from the top.
pub(super) const PANELS_END: u32 = 916;
/// Line spacing of text, pixels.
const LINE: u32 = 22;
/// Largest number of lines of remarks.
const MOST_LINES: usize = 24;

/// Colour of remarks.
fn colour(severity: Severity) -> Colour {
    match severity {
        Severity::Severe => SEVERE,
        Severity::Caution => WARNING,
        Severity::Note => FAINT,
    }
}

/// Something a person should know, in one sentence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Remark {
    pub(super) severity: Severity,
    pub(super) text: String,
}

/// Appearance of an item in the panels.
#[derive(Debug, Clone, Copy)]
pub(super) enum Swatch {
    Area(Colour),
    Line(Colour),
    Dot(Colour),
}

/// Everything around the panels.
pub(super) struct Frame {
    pub(super) title: String,
    pub(super) legend: Vec<(Swatch, String)>,
    pub(super) facts: Vec<String>,
    pub(super) remarks: Vec<Remark>,
}

impl Frame {
    /// Creates a picture with header, legend, facts and remarks; panels are drawn into it.
    pub(super) fn canvas(&self, legend: Rect) -> Canvas {
        let lines = self.remark_lines();
        let remarks_end = PANELS_END + GAP + LINE * lines.len() as u32 + GAP;
        let mut canvas = Canvas::new(WIDTH, HEIGHT.max(remarks_end), PAGE);
        self.header(&mut canvas);
        self.legend(&mut canvas, legend);
        for (line, (text, colour)) in lines.iter().enumerate() {
            let y = PANELS_END + GAP + LINE * line as u32;
            canvas.text(text, [GAP, y], 2, *colour);
        }
        canvas
    }

    fn header(&self, canvas: &mut Canvas) {
        let most = ((WIDTH - 2 * GAP) / (3 * GLYPH)) as usize;
        let title: String = self.title.chars().take(most).collect();
        canvas.text(&title, [GAP, 10], 3, INK);
        let mut x = GAP;
        for (text, colour) in self.verdict() {
            canvas.text(&text, [x, 46], 3, colour);
            x += text_width(&text, 3) + 3 * GLYPH;
        }
    }

    /// Number of remarks of each severity that a person has to check.
    fn verdict(&self) -> Vec<(String, Colour)> {
        let count = |severity| {
            let remarks = self.remarks.iter();
            remarks.filter(|r| r.severity == severity).count()
        };
        let listed = [Severity::Severe, Severity::Caution].into_iter();
        let listed: Vec<_> = listed
            .filter(|severity| count(*severity) > 0)
            .map(|severity| {
                let text = match severity {
                    Severity::Severe => format!("{} severe", count(severity)),
                    _ => ppa_core::text::count(count(severity), &severity.to_string()),
                };
                (text, colour(severity))
            })
            .collect();
        if listed.is_empty() {
            return vec![("no findings".to_owned(), GOOD)];
        }
        listed
    }

    fn remark_lines(&self) -> Vec<(String, Colour)> {
        let most = ((WIDTH - 2 * GAP) / (2 * GLYPH)) as usize;
        let mut remarks: Vec<_> = self.remarks.iter().collect();
        remarks.sort_by_key(|remark| std::cmp::Reverse(remark.severity));
        let mut lines = Vec::new();
        for (index, remark) in remarks.iter().enumerate() {
            let text = format!("{}: {}", remark.severity, remark.text);
            let mut parts = wrapped(&text, most - 2);
            parts[1..]
                .iter_mut()
                .for_each(|part| part.insert_str(0, "  "));
            if lines.len() + parts.len() > MOST_LINES {
                let more = format!("... and {} more, in the case file", remarks.len() - index);
                lines.push((more, INK));
                break;
            }
            lines.extend(
                parts
                    .into_iter()
                    .map(|part| (part, colour(remark.severity))),
            );
        }
        lines
    }

    fn legend(&self, canvas: &mut Canvas, rect: Rect) {
        const SWATCH: u32 = 28;
        let most = ((rect.width - SWATCH - GAP) / (2 * GLYPH)) as usize;
        let mut y = rect.y + 4;
        for (swatch, text) in &self.legend {
            let (left, middle) = (f64::from(rect.x), f64::from(y + GLYPH));
            match swatch {
                Swatch::Area(colour) => canvas.fill(
                    Rect {
                        x: rect.x,
                        y,
                        width: SWATCH,
                        height: 2 * GLYPH,
                    },
                    *colour,
                ),
                Swatch::Line(colour) => {
                    canvas.line(
                        [left, middle],
                        [left + f64::from(SWATCH), middle],
                        3.0,
                        *colour,
                    );
                }
                Swatch::Dot(colour) => {
                    canvas.ring([left + 0.5 * f64::from(SWATCH), middle], 0.0, 6.0, *colour);
                }
            }
            for line in wrapped(text, most) {
                canvas.text(&line, [rect.x + SWATCH + GAP, y], 2, INK);
                y += LINE;
            }
            y += 4;
        }
        y += LINE;
        let most = (rect.width / (2 * GLYPH)) as usize;
        for fact in &self.facts {
            for line in wrapped(fact, most) {
                canvas.text(&line, [rect.x, y], 2, FAINT);
                y += LINE;
            }
            y += 6;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(remarks: Vec<Remark>) -> Frame {
        Frame {
            title: "leg.case.toml".repeat(20),
            legend: Vec::new(),
            facts: Vec::new(),
            remarks,
        }
    }

    const LEGEND: Rect = Rect {
        x: 1200,
        y: 80,
        width: 380,
        height: 800,
    };

    #[test]
    fn severe_remarks_come_first_and_many_make_the_picture_higher() {
        let remark = |severity, text: &str| Remark {
            severity,
            text: text.to_owned(),
        };
        let few = frame(vec![
            remark(Severity::Note, "n"),
            remark(Severity::Severe, "s"),
            remark(Severity::Caution, "w"),
        ]);
        let lines: Vec<_> = few
            .remark_lines()
            .into_iter()
            .map(|(text, _)| text)
            .collect();
        assert_eq!(lines, ["severe: s", "caution: w", "note: n"]);
        assert_eq!(few.verdict()[0].0, "1 severe");
        let image = few.canvas(LEGEND).into_image();
        assert_eq!(image.dimensions(), (WIDTH, HEIGHT));
        let many = frame(vec![remark(Severity::Caution, &"word ".repeat(60)); 40]);
        let lines = many.remark_lines();
        assert!(lines.len() <= MOST_LINES + 1);
        assert!(lines.last().unwrap().0.ends_with("more, in the case file"));
        assert!(many.canvas(LEGEND).into_image().height() > HEIGHT);
        assert_eq!(frame(Vec::new()).verdict()[0].0, "no findings");
    }
}
