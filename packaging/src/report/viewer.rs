//! The animation of the report: data, controls and explanation.

use std::fmt::Write as _;

use serde_json::json;
use tiprub_field::animation::HitBlade;
use tiprub_figure::escape;
use tiprub_shell::Result;

use super::input::ReportInput;
use super::numbers::{rounded, with_prefix};

/// JavaScript program of the animation.
const PROGRAM: &str = include_str!("viewer.js");

/// Returns the section with the animation.
///
/// # Errors
/// The data cannot be compressed.
pub(super) fn section(input: &ReportInput<'_>, blade: Option<&HitBlade>) -> Result<String> {
    let animation = input.capture.animation()?;
    let mut header = animation.header;
    header["hit"] =
        json!(blade.map(|blade| json!({ "body": blade.structure, "sector": blade.sector, "time": blade.time })));
    // A closing tag in a name would end the script.
    let header = header.to_string().replace('<', "\\u003c");
    let [start, stop] = animation.interval;
    let mut html = String::from(
        "<section class=\"viewer\" id=\"viewer\" aria-label=\"Animation of the contact\">\n<div class=\"stage\">\
         <canvas tabindex=\"0\" role=\"img\" aria-label=\"Three-dimensional picture of the run. The arrow keys rotate it; plus and minus \
         zoom.\"></canvas><output class=\"now\"></output><p class=\"note\" hidden></p><div class=\"key\" aria-hidden=\"true\">\
         <span><i class=\"cool\"></i>displacement <b></b></span><span><i class=\"hot\"></i>contact force <b></b></span></div></div>\n",
    );
    let views = blade.filter(|blade| blade.sectors > 1).map_or(String::new(), |blade| {
        format!(
            "<fieldset><legend>View</legend><label><input type=\"radio\" name=\"view\" value=\"all\" checked>whole rotor</label>\
             <label><input type=\"radio\" name=\"view\" value=\"blade\">{}</label>\
             <label><input type=\"checkbox\" name=\"turn\">rotate with the rotor</label></fieldset>",
            input.blade_name(blade)
        )
    });
    let _ = writeln!(
        html,
        "<div class=\"controls\"><button type=\"button\" class=\"play\">Play</button>\
         <label class=\"time\"><span>Time <b class=\"value\"></b></span><svg class=\"strip\" preserveAspectRatio=\"none\" \
         viewBox=\"0 0 1000 24\" aria-hidden=\"true\"><path/></svg>\
         <input type=\"range\" name=\"time\" min=\"0\" max=\"2000\" step=\"1\" value=\"0\"></label>\
         <label class=\"scale\"><span>Exaggeration <b class=\"value\"></b></span>\
         <input type=\"range\" name=\"scale\" min=\"0\" max=\"1000\" step=\"1\" value=\"500\"></label>\
         <label class=\"pace\"><span>Playback</span><select name=\"pace\"><option value=\"0.25\">¼</option><option value=\"0.5\">½</option>\
         <option value=\"1\" selected>1</option><option value=\"2\">2</option></select></label>{views}</div>"
    );
    let _ = writeln!(
        html,
        "<div class=\"explain\">{}</div>",
        explanation(input, [start, stop], animation.is_cut, animation.deviation)
    );
    let _ = write!(
        html,
        "<script type=\"application/json\" id=\"run-header\">{header}</script>\n\
         <script type=\"text/plain\" id=\"run-data\">{}</script>\n<script>\n{PROGRAM}</script>\n\
         <noscript><p>The animation needs JavaScript. All figures below are complete without it.</p></noscript></section>\n",
        animation.data
    );
    Ok(html)
}

/// Explains which interval is shown, what is exaggerated and what is missing, as HTML.
fn explanation(input: &ReportInput<'_>, [start, stop]: [f64; 2], is_cut: bool, deviation: f64) -> String {
    let whole = stop - start >= 0.999 * (input.schedule.stop - input.schedule.start);
    let interval = if whole {
        "The animation shows the whole run".to_owned()
    } else {
        format!("The animation shows the run from {} to {}", with_prefix(start, "s"), with_prefix(stop, "s"))
    };
    let cut = if is_cut { ", which includes the largest force; contact also occurs at other times" } else { "" };
    let mut text = format!("<p>{interval}{cut}.");
    if input.capture.has_rings() {
        text.push_str(
            " Displacements, the gap between tips and casing and the shape of the casing are exaggerated by the same factor, so \
             that contact nodes meet the casing in the picture when they do in the run. The sizes of blades and casing and the \
             rotation are not exaggerated. A grey drum replaces the disk if the model has none.",
        );
    } else {
        text.push_str(
            " Elastic displacements are exaggerated, but the rigid motion of free bodies is not. With a large factor, bodies that \
             touch may overlap in the picture.",
        );
    }
    text.push_str(
        " Orange light marks contacts. Its strength shows the mean normal force of a communication step, relative to the largest \
         one of the interval.",
    );
    if deviation > 0.0 {
        let _ = write!(
            text,
            " The drawn displacements deviate from the run by at most {} %. Points and instants that are not drawn may have larger ones.",
            rounded(100.0 * deviation)
        );
    }
    let alone: Vec<String> = input.capture.without_surface().into_iter().map(escape).collect();
    if !alone.is_empty() {
        let verb = if alone.len() == 1 { "is" } else { "are" };
        let _ = write!(
            text,
            " <b>{} {verb} shown by contact nodes only</b>, because no shape file belongs to the ROM; <code>tiprub reduce</code> \
             writes one beside the ROM of a mesh.",
            alone.join(", ")
        );
    }
    text + " Drag the picture to rotate it, use Ctrl and the mouse wheel to zoom, and double-click to restore the first view.</p>"
}
