//! `bottega request`: prints, checks and converts requests.

use std::process::ExitCode;

use bottega::{Request, RequestError, picture::request_of};

use crate::{
    cli::{RequestCommand, RequestCommandArgs, line, read_request, words},
    error::CliError,
};

pub(crate) fn run(args: &RequestCommandArgs) -> Result<ExitCode, CliError> {
    let request = match &args.command {
        RequestCommand::Schema => {
            let schema = serde_json::to_string_pretty(&Request::schema());
            print!("{}\n", schema.unwrap_or_default());
            return Ok(ExitCode::SUCCESS);
        }
        RequestCommand::Options { file } => {
            println!("bottega render {}", line(&words(&read_request(file)?).map_err(unwritable)?));
            return Ok(ExitCode::SUCCESS);
        }
        RequestCommand::Check { file } => read_request(file)?,
        RequestCommand::Show { picture } => request_of(picture)?,
    };
    print!("{}\n", request.to_json().map_err(unwritable)?);
    Ok(ExitCode::SUCCESS)
}

fn unwritable(source: RequestError) -> CliError {
    bottega::Error::Request { origin: "what was given".to_owned(), source }.into()
}
