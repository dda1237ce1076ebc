//! Parsers of values that concern energy, in options and in the configuration file.

use crate::option_value::InvalidValue;

/// Parses a power, in watts.
pub(crate) fn parse_watts(text: &str) -> Result<f64, InvalidValue> {
    let watts = text.parse().ok().filter(|watts: &f64| *watts > 0.0 && *watts <= 1e6);
    watts.ok_or_else(|| "a number of watts above 0 is needed, such as 120".into())
}

/// Parses a price of energy, per kWh.
pub(crate) fn parse_price(text: &str) -> Result<f64, InvalidValue> {
    let price = text.parse().ok().filter(|price: &f64| (0.0..=1e6).contains(price));
    price.ok_or_else(|| "a price from 0 up is needed, such as 0.31".into())
}

/// Parses a currency, by code or sign.
pub(crate) fn parse_currency(text: &str) -> Result<String, InvalidValue> {
    let is_code =
        (1..=8).contains(&text.chars().count()) && text.chars().all(|c| c.is_alphabetic() || "€$£¥".contains(c));
    if is_code { Ok(text.to_owned()) } else { Err("a currency of 1 to 8 letters is needed, such as EUR".into()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prices_and_watts_are_checked() {
        assert_eq!(
            (parse_watts("95.5"), parse_price("0"), parse_currency("EUR")),
            (Ok(95.5), Ok(0.0), Ok("EUR".to_owned()))
        );
        for absurd in ["", "0", "-1", "nan", "inf", "2e6", "a lot"] {
            assert!(parse_watts(absurd).is_err(), "{absurd}");
        }
        for absurd in ["", "-0.1", "nan", "inf"] {
            assert!(parse_price(absurd).is_err(), "{absurd}");
        }
        for absurd in ["", "EUROCENTS", "E R", "<b>"] {
            assert!(parse_currency(absurd).is_err(), "{absurd}");
        }
    }
}
