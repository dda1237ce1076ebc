//! A sequence diagram of messages: a lifeline per agent, an arrow per message.

use bottega_image::{Svg, svg_text};

use super::passed::PassedMessage;

/// Sizes in pixels.
const LEFT: f64 = 110.0;
const TOP: f64 = 56.0;
const LANE_WIDTH: f64 = 210.0;
const ROW_HEIGHT: f64 = 26.0;
/// The maximum length of names, in characters.
const NAME_MAX: usize = 32;

/// Formats one message as text.
pub(super) fn row(passed: &PassedMessage, conversation: usize) -> String {
    let arrow = match passed.way.as_str() {
        "dropped" => "x",
        "lost" => "?",
        _ => ">",
    };
    let protocol = if passed.protocol.is_empty() { "" } else { &passed.protocol };
    format!(
        "{}  #{conversation:<4} {:>28} --{:-^17}-{arrow} {:<28} {protocol}",
        passed.clock(),
        cut(&passed.from, 28),
        format!(" {} ", passed.act),
        cut(&passed.to, 28),
    )
}

fn cut(text: &str, most: usize) -> String {
    if text.chars().count() <= most { text.to_owned() } else { text.chars().take(most - 1).chain(['…']).collect() }
}

/// Returns an SVG drawing of all messages: agents in order of their first message, one color per conversation.
pub(super) fn svg(messages: &[PassedMessage]) -> String {
    let mut agents: Vec<&str> = Vec::new();
    let mut conversations: Vec<&str> = Vec::new();
    for message in messages {
        for agent in [message.from.as_str(), message.to.as_str()] {
            if !agents.contains(&agent) {
                agents.push(agent);
            }
        }
        if !conversations.contains(&message.conversation.as_str()) {
            conversations.push(&message.conversation);
        }
    }
    let width = LEFT + LANE_WIDTH * agents.len().max(1) as f64;
    let height = TOP + ROW_HEIGHT * (messages.len() + 1) as f64;
    let mut svg = Svg::new(width, height, 11);
    let x_of = |agent: &str| {
        let lane = agents.iter().position(|other| *other == agent).unwrap_or(0);
        LEFT + LANE_WIDTH * (lane as f64 + 0.5)
    };
    for agent in &agents {
        let x = x_of(agent);
        svg.text([x, TOP - 22.0], "text-anchor=\"middle\" font-weight=\"bold\"", cut(agent, NAME_MAX));
        svg.put(format_args!(
            "<line x1=\"{x:.0}\" y1=\"{:.0}\" x2=\"{x:.0}\" y2=\"{height:.0}\" stroke=\"#bbb\" stroke-dasharray=\"3 3\"/>",
            TOP - 14.0
        ));
    }
    for (index, message) in messages.iter().enumerate() {
        let number = conversations.iter().position(|other| *other == message.conversation).unwrap_or(0);
        let y = TOP + ROW_HEIGHT * (index as f64 + 0.7);
        arrow(&mut svg, message, number, [x_of(&message.from), x_of(&message.to)], y);
    }
    svg.finish()
}

fn arrow(svg: &mut Svg, message: &PassedMessage, conversation: usize, [from, to]: [f64; 2], y: f64) {
    // Hues a golden angle apart are easy to distinguish.
    let hue = (conversation as f64 * 137.508).rem_euclid(360.0);
    let reached = matches!(message.way.as_str(), "in" | "out");
    let (color, dash) =
        if reached { (format!("hsl({hue:.0} 60% 38%)"), "") } else { ("#c00".to_owned(), " stroke-dasharray=\"5 3\"") };
    let title = format!(
        "{} {} {} to {}, {}: {}",
        message.way, message.act, message.from, message.to, message.conversation, message.content
    );
    svg.put(format_args!("<g><title>{}</title>", svg_text(&title)));
    svg.text([6.0, y + 3.0], "fill=\"#666\"", format_args!("{} #{}", message.clock(), conversation + 1));
    if from == to {
        svg.put(format_args!(
            "<path d=\"M{from:.0} {:.0} h 34 v 10 h -30\" fill=\"none\" stroke=\"{color}\"{dash}/>",
            y - 6.0
        ));
    } else {
        let back = if to > from { -7.0 } else { 7.0 };
        svg.put(format_args!(
            "<line x1=\"{from:.0}\" y1=\"{y:.0}\" x2=\"{to:.0}\" y2=\"{y:.0}\" stroke=\"{color}\"{dash}/>\n<path \
             d=\"M{to:.0} {y:.0} l {back} -4 v 8 z\" fill=\"{color}\"/>"
        ));
    }
    let x = if from == to { from + 60.0 } else { (from + to) / 2.0 };
    svg.text([x, y - 4.0], &format!("text-anchor=\"middle\" fill=\"{color}\""), &message.act);
    svg.put("</g>");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_diagram_has_a_line_for_each_agent_and_an_arrow_for_each_message() {
        let passed = |from: &str, to: &str, way: &str| PassedMessage {
            at: "20261121T101500123Z".into(),
            way: way.into(),
            act: "request".into(),
            from: from.into(),
            to: to.into(),
            conversation: "c<1>".into(),
            protocol: "fipa-request".into(),
            content: "\"&\u{1}".into(),
        };
        let drawing = svg(&[passed("a@x", "b@y", "in"), passed("b@y", "a@x", "lost"), passed("a@x", "a@x", "in")]);
        assert_eq!(drawing.matches("font-weight").count(), 2);
        assert_eq!(drawing.matches("<g><title>").count(), 3);
        assert!(drawing.contains("c&lt;1&gt;: &quot;&amp; </title>") && drawing.contains("#c00"));
        let line = row(&passed("a@x", "b@y", "in"), 1);
        assert!(line.starts_with("10:15:00.123  #1") && line.contains("request") && line.contains("b@y"), "{line}");
    }
}
