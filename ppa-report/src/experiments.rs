//! The page of the experiments: tables with the paper's numbers for comparison, charts, and the poses with the largest errors.

use image::{ImageResult, Rgb, RgbImage};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use ppa_dataset::published::GrayImage16;
use ppa_depth::false_colour;

use crate::chart::Chart;
use crate::embedded::data_uri;

/// Width of a picture on the page, pixels.
const PICTURE: u32 = 192;

/// One experiment on the page.
#[derive(Debug, Clone)]
pub struct ExperimentPart {
    /// Its name and question.
    pub title: String,
    /// Its verdicts and tests in sentences.
    pub findings: Vec<String>,
    /// Missing or failed parts.
    pub failures: Vec<String>,
    /// Headings of the table's columns.
    pub headings: Vec<String>,
    /// Name and cells of the table's rows.
    pub rows: Vec<(String, Vec<ResultCell>)>,
    /// Notes on how to read the table.
    pub notes: Vec<String>,
    /// Captions and charts.
    pub charts: Vec<(String, Chart)>,
    /// Poses with the largest errors.
    pub worst: Vec<WorstPose>,
}

/// A cell of a table of results.
#[derive(Debug, Clone)]
pub struct ResultCell {
    /// Our number.
    pub text: String,
    /// Whether it is the best of its row.
    pub best: bool,
    /// The paper's number.
    pub published: Option<String>,
}

/// A pose with its prediction and images.
#[derive(Debug, Clone)]
pub struct WorstPose {
    /// Person, pose, label and prediction.
    pub caption: String,
    /// Input of the networks: depths in mm, 0 if invalid.
    pub images: Vec<GrayImage16>,
}

/// Writes the experiments as one HTML page without external addresses.
///
/// # Errors
/// [`image::ImageError`] if a picture cannot be encoded.
pub fn experiments_page(parts: &[ExperimentPart]) -> ImageResult<String> {
    let sections: Vec<Markup> = parts.iter().map(section).collect::<ImageResult<_>>()?;
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width";
                title { "Experiments" }
                style { (PreEscaped(include_str!("page.css"))) }
            }
            body {
                main {
                    h1 { "Experiments" }
                    @for part in parts {
                        h3 { (part.title) }
                        @if !part.failures.is_empty() {
                            ul class="bad" { @for failure in &part.failures { li { (failure) } } }
                        }
                        ul { @for finding in &part.findings { li { (finding) } } }
                    }
                    @for section in sections { (section) }
                }
            }
        }
    };
    Ok(page.into_string())
}

fn section(part: &ExperimentPart) -> ImageResult<Markup> {
    let worst: Vec<(String, Vec<String>)> = part
        .worst
        .iter()
        .map(|pose| {
            let images = pose.images.iter().map(|image| data_uri(&picture(image)));
            Ok((pose.caption.clone(), images.collect::<ImageResult<_>>()?))
        })
        .collect::<ImageResult<_>>()?;
    Ok(html! {
        h2 { (part.title) }
        (table(part))
        @for note in &part.notes { p { (note) } }
        div class="charts" {
            @for (caption, chart) in &part.charts {
                figure {
                    div role="img" aria-label=(caption) { (PreEscaped(chart.to_inline_svg())) }
                    figcaption { (caption) }
                }
            }
        }
        @if !worst.is_empty() {
            h3 { "Largest errors" }
            div class="charts" {
                @for (caption, images) in &worst {
                    figure {
                        div class="views" { @for image in images { img src=(image) alt="depth image"; } }
                        figcaption { (caption) }
                    }
                }
            }
        }
    })
}

fn table(part: &ExperimentPart) -> Markup {
    html! {
        table {
            tr { th { "Metric" } @for heading in &part.headings { th { (heading) } } }
            @for (metric, cells) in &part.rows {
                tr {
                    th { (metric) }
                    @for cell in cells {
                        td {
                            @if cell.best { strong { (cell.text) } } @else { (cell.text) }
                            @if let Some(published) = &cell.published { br; small { "paper " (published) } }
                        }
                    }
                }
            }
        }
    }
}

/// A depth image in false colour from its nearest to its farthest valid pixel.
fn picture(image: &GrayImage16) -> RgbImage {
    let valid = image
        .pixels
        .iter()
        .filter(|&&depth| depth > 0)
        .map(|&depth| f64::from(depth));
    let [near, far] = valid.fold([f64::INFINITY, 0.0], |[near, far], z| {
        [near.min(z), far.max(z)]
    });
    let view = RgbImage::from_fn(image.width, image.height, |x, y| {
        let depth = image.pixels[(y * image.width + x) as usize];
        Rgb(false_colour(depth.into(), [near, far.max(near + 1.0)]))
    });
    let height = PICTURE * image.height / image.width.max(1);
    image::imageops::resize(
        &view,
        PICTURE,
        height.max(1),
        image::imageops::FilterType::Nearest,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_and_pictures_stand_on_the_page() {
        let cell = |text: &str, best, published: Option<&str>| ResultCell {
            text: text.to_owned(),
            best,
            published: published.map(str::to_owned),
        };
        let part = ExperimentPart {
            title: "1: synthetic images".to_owned(),
            findings: vec!["better <than> all".to_owned()],
            failures: vec!["one diverged".to_owned()],
            headings: vec!["scratch".to_owned(), "constant".to_owned()],
            rows: vec![(
                "MAE".to_owned(),
                vec![cell("0.20", true, Some("0.23")), cell("0.70", false, None)],
            )],
            notes: Vec::new(),
            charts: Vec::new(),
            worst: vec![WorstPose {
                caption: "patient 3".to_owned(),
                images: vec![GrayImage16 {
                    width: 2,
                    height: 1,
                    pixels: vec![900, 0],
                }],
            }],
        };
        let page = experiments_page(&[part]).unwrap();
        for expected in [
            "<strong>0.20</strong><br><small>paper 0.23</small>",
            "<td>0.70</td>",
            "better &lt;than&gt; all",
            "one diverged",
            "src=\"data:image/png;base64,",
        ] {
            assert!(page.contains(expected), "{expected} in {page}");
        }
        assert!(!page.contains("http"));
    }
}
