//! Files of the page, embedded in the program, so that the browser needs no other server.

/// A file of the page.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asset {
    /// Name in the page's folder; empty for the page itself.
    pub(super) name: &'static str,
    /// Media type.
    pub(super) media: &'static str,
    pub(super) text: &'static str,
}

const HTML: &str = "text/html; charset=utf-8";
const STYLE: &str = "text/css; charset=utf-8";
const IMAGE: &str = "image/svg+xml";
const SCRIPT: &str = "text/javascript; charset=utf-8";

macro_rules! assets {
    ($($name:literal, $media:ident, $file:literal;)*) => {
        &[$(Asset { name: $name, media: $media, text: include_str!($file) }),*]
    };
}

const ASSETS: &[Asset] = assets! {
    "", HTML, "page/index.html";
    "icon.svg", IMAGE, "page/icon.svg";
    "page.css", STYLE, "page/page.css";
    "page.js", SCRIPT, "page/page.js";
    "calibration.js", SCRIPT, "page/calibration.js";
    "connection.js", SCRIPT, "page/connection.js";
    "elements.js", SCRIPT, "page/elements.js";
    "measurements.js", SCRIPT, "page/measurements.js";
    "plots.js", SCRIPT, "page/plots.js";
    "readings.js", SCRIPT, "page/readings.js";
    "text.js", SCRIPT, "page/text.js";
    "touch.js", SCRIPT, "page/touch.js";
    "uPlot.iife.min.js", SCRIPT, "uplot-1.6.32/uPlot.iife.min.js";
    "uPlot.min.css", STYLE, "uplot-1.6.32/uPlot.min.css";
};

/// Returns the file with a name.
pub(super) fn asset(name: &str) -> Option<&'static Asset> {
    ASSETS.iter().find(|asset| asset.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names that a text imports or links.
    fn named(text: &'static str) -> impl Iterator<Item = &'static str> {
        let marks = ["src=\"", "href=\"", "from \"./"];
        marks.into_iter().flat_map(move |mark| {
            let after = text.split(mark).skip(1);
            after.filter_map(|rest| rest.split('"').next())
        })
    }

    #[test]
    fn every_file_that_the_page_names_is_there_and_none_is_elsewhere() {
        let ours = ASSETS.iter().filter(|of| !of.name.starts_with("uPlot"));
        let names: Vec<_> = ours.flat_map(|of| named(of.text)).collect();
        assert!(names.len() > 6, "{names:?}");
        for name in names {
            assert!(asset(name).is_some(), "{name}");
        }
    }

    #[test]
    fn uplot_is_the_version_that_its_folder_says() {
        assert!(
            asset("uPlot.iife.min.js")
                .unwrap()
                .text
                .contains("(v1.6.32)")
        );
        assert!(include_str!("uplot-1.6.32/LICENSE").starts_with("The MIT License"));
    }
}
