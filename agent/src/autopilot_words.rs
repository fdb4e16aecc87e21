//! The autopilot's lines, as they are told to the ground: the most serious first, no more than some a second, and
//! repeated ones counted.

use std::time::Duration;

use skein_mav::{Severity, Text};

use crate::report::Report;

/// Lines are told so far apart.
const APART: Duration = Duration::from_millis(300);
/// The same line is not told again before so long.
const SAME_AGAIN: Duration = Duration::from_secs(10);
/// So many different lines are kept; what comes beside them is counted.
const MOST_LINES: usize = 32;
/// Less serious ones stand in the agent's log alone.
const LEAST: Severity = Severity::Info;

/// Lines that wait to be told, and those that were told lately.
#[derive(Debug, Default)]
pub struct AutopilotWords {
    lines: Vec<Line>,
    /// Those for which there was no room.
    left_out: i64,
    next_at: Duration,
}

#[derive(Debug)]
struct Line {
    text: Text,
    /// Times that it came since it was told.
    times: i64,
    told_at: Option<Duration>,
}

impl Line {
    fn waits(&self, now: Duration) -> bool {
        self.times > 0 && self.told_at.is_none_or(|told_at| now >= told_at + SAME_AGAIN)
    }

    fn is_over(&self, now: Duration) -> bool {
        self.times == 0 && self.told_at.is_some_and(|told_at| now >= told_at + SAME_AGAIN)
    }
}

impl AutopilotWords {
    /// Takes in a line of the autopilot.
    pub fn hear(&mut self, text: &Text) {
        if text.severity > LEAST {
            return;
        }
        if let Some(line) = self.lines.iter_mut().find(|line| line.text == *text) {
            line.times += 1;
        } else if self.lines.len() < MOST_LINES {
            self.lines.push(Line { text: text.clone(), times: 1, told_at: None });
        } else {
            self.left_out += 1;
        }
    }

    /// The next line to tell, if one may be told by now.
    pub fn tell(&mut self, now: Duration) -> Option<Report> {
        if now < self.next_at {
            return None;
        }
        self.lines.retain(|line| !line.is_over(now));
        let waiting = self.lines.iter_mut().filter(|line| line.waits(now));
        if let Some(line) = waiting.min_by_key(|line| line.text.severity) {
            (line.told_at, self.next_at) = (Some(now), now + APART);
            let times = std::mem::take(&mut line.times);
            return Some(Report::AutopilotSays { text: line.text.clone(), times });
        }
        let times = std::mem::take(&mut self.left_out);
        (times > 0).then(|| {
            self.next_at = now + APART;
            let text = "further lines, which stand in its agent's log".to_owned();
            Report::AutopilotSays { text: Text { severity: Severity::Notice, text }, times }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(severity: Severity, text: &str) -> Text {
        Text { severity, text: text.to_owned() }
    }

    /// All that is told in so many seconds, ticked 50 times in each: words and how often.
    fn told(words: &mut AutopilotWords, from_s: u64, seconds: u64) -> Vec<(String, i64)> {
        let ticks = (from_s * 50)..((from_s + seconds) * 50);
        let reports = ticks.filter_map(|tick| words.tell(Duration::from_millis(20 * tick)));
        reports
            .filter_map(|report| match report {
                Report::AutopilotSays { text, times } => Some((text.text, times)),
                _ => None,
            })
            .collect()
    }

    #[test]
    fn the_most_serious_is_told_first_and_what_is_for_developers_never() {
        let mut words = AutopilotWords::default();
        for (severity, text) in
            [(Severity::Info, "Armed"), (Severity::Debug, "loop"), (Severity::Critical, "Motor lost")]
        {
            words.hear(&line(severity, text));
        }
        assert_eq!(told(&mut words, 0, 2), [("Motor lost".to_owned(), 1), ("Armed".to_owned(), 1)]);
    }

    #[test]
    fn a_line_that_is_repeated_is_counted() {
        let mut words = AutopilotWords::default();
        words.hear(&line(Severity::Warning, "low"));
        assert_eq!(told(&mut words, 0, 1), [("low".to_owned(), 1)]);
        (0..500).for_each(|_| words.hear(&line(Severity::Warning, "low")));
        assert_eq!(told(&mut words, 1, 8), []);
        assert_eq!(told(&mut words, 9, 20), [("low".to_owned(), 500)]);
        words.hear(&line(Severity::Warning, "low"));
        assert_eq!(told(&mut words, 40, 1), [("low".to_owned(), 1)]);
    }

    #[test]
    fn of_a_flood_some_a_second_are_told_and_the_rest_are_counted() {
        let mut words = AutopilotWords::default();
        (0..1000).for_each(|number| words.hear(&line(Severity::Info, &format!("line {number}"))));
        assert!((2..=4).contains(&told(&mut words, 0, 1).len()));
        let rest = told(&mut words, 1, 60);
        assert_eq!(rest.last().map(|(_, times)| *times), Some(1000 - MOST_LINES as i64), "{rest:?}");
    }
}
