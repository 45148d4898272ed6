//! The command line of `abbe-render`: the options of `abbe render` that concern an exported scene.

use std::ffi::OsString;
use std::path::PathBuf;
use std::str::FromStr;

use abbe::render::Request;
use abbe::{Error, Result};
use lexopt::prelude::*;

/// What `--help` prints.
pub(crate) const HELP: &str = "\
abbe-render SCENE.safetensors [OUT.exr] [options]

Renders a scene that `abbe export` wrote, to the same bits as `abbe render`. Without OUT the scene's products name the files.
What is not given, the scene's render settings decide.

  --camera PATH            a camera of the scene
  --product PATH           the one product to render
  --width N, --height N    pixels; one alone keeps the aspect
  --samples N              samples per pixel; the most of them with an error target
  --error-target X         relative error at which a pixel gets no more samples
  --time-limit S           seconds after which the image is finished with the samples that it has
  --pixel-filter NAME      box, triangle, gaussian, blackmanHarris: how light is spread over pixels
  --pixel-filter-width W   its full width, pixels
  --clamp X                the most a sample of the beauty may have; counted and reported
  --depth-of-field on|off  spread samples over the lens, or not; as the scene says unless given
  --integrator NAME        what computes a pixel
  --aov NAME               an AOV to render, instead of the scene's; repeat for more
  --wavelength NM          reference wavelength
  --band LO:HI             wavelength band of footprints, nm
  --motion-blur on|off     spread samples over the shutter, or not; as the scene says unless given
  --dispersion-scale S     multiplies all dispersion: 0 none, 1 physical
  --max-depth N            how often light may be scattered; --max-diffuse-depth, --max-reflection-depth,
                           --max-transmission-depth by kind; unlimited unless given
  --plate FILE             image that is seen through glass, behind everything
  --seed N                 same seed, same bits
  --threads N              all of the machine's unless given; never changes a bit
  --texture-memory MB      for the texels of images, 4294 unless given; never changes a bit
  --crop X0,Y0,X1,Y1       pixels to render, half-open, y down
  --sample-range A:B       samples to render, half-open; `abbe merge` joins parts
  --strict                 any warning is an error, and nothing is written
  --mmap                   map the scene into memory; the file must not change meanwhile
  --stats FILE.json        write what was counted, chosen and warned of
  --quiet                  no progress and no warnings
  --help, --version

Exit codes: 0 all written, 1 failed, 2 usage, 3 a part written, 130 Ctrl-C, 143 SIGTERM.
";

/// What a call asks for.
pub(crate) enum Command {
    /// Print this text.
    Print(String),
    /// Render.
    Render(Box<Args>),
}

/// The arguments of a render.
#[derive(Default)]
pub(crate) struct Args {
    pub(crate) scene: PathBuf,
    pub(crate) out: Option<PathBuf>,
    pub(crate) request: Request,
    pub(crate) mapped: bool,
    pub(crate) stats: Option<PathBuf>,
    pub(crate) quiet: bool,
}

/// Reads the arguments after the program's name.
pub(crate) fn parse(arguments: impl IntoIterator<Item = OsString>) -> Result<Command> {
    read(lexopt::Parser::from_args(arguments))
}

fn read(mut parser: lexopt::Parser) -> Result<Command> {
    let mut args = Args::default();
    let mut positional = Vec::new();
    while let Some(argument) = parser.next().map_err(wrong)? {
        let option = match argument {
            Value(path) => {
                positional.push(PathBuf::from(path));
                continue;
            }
            Short(letter) => return Err(Error::usage(format!("-{letter}"), "there is no such option; see --help")),
            Long(name) => name.to_owned(),
        };
        let request = &mut args.request;
        match option.as_str() {
            "help" => return Ok(Command::Print(HELP.to_owned())),
            "version" => return Ok(Command::Print(format!("abbe-render {}\n", env!("CARGO_PKG_VERSION")))),
            "camera" => request.camera = Some(text(&mut parser, &option)?),
            "product" => request.product = Some(text(&mut parser, &option)?),
            "width" => request.width = Some(number(&mut parser, &option)?),
            "height" => request.height = Some(number(&mut parser, &option)?),
            "samples" => request.samples = Some(number(&mut parser, &option)?),
            "error-target" | "error" => request.error_target = Some(number(&mut parser, &option)?),
            "time-limit" => request.time_limit = Some(number(&mut parser, &option)?),
            "pixel-filter" => request.pixel_filter = Some(text(&mut parser, &option)?),
            "pixel-filter-width" => request.pixel_filter_width = Some(number(&mut parser, &option)?),
            "clamp" => request.clamp = Some(number(&mut parser, &option)?),
            "depth-of-field" => request.depth_of_field = Some(on_or_off(&mut parser, &option)?),
            "motion-blur" => request.motion_blur = Some(on_or_off(&mut parser, &option)?),
            "integrator" => request.integrator = Some(text(&mut parser, &option)?),
            "aov" => request.aovs.get_or_insert_default().push(text(&mut parser, &option)?),
            "wavelength" => request.wavelength = Some(number(&mut parser, &option)?),
            "band" => request.band = Some(numbers(&mut parser, &option, ':', "LO:HI")?),
            "dispersion-scale" => request.dispersion_scale = Some(number(&mut parser, &option)?),
            "max-depth" => request.max_depth = Some(number(&mut parser, &option)?),
            "max-diffuse-depth" => request.max_diffuse_depth = Some(number(&mut parser, &option)?),
            "max-reflection-depth" => request.max_reflection_depth = Some(number(&mut parser, &option)?),
            "max-transmission-depth" => request.max_transmission_depth = Some(number(&mut parser, &option)?),
            "plate" => request.plate = Some(text(&mut parser, &option)?),
            "seed" => request.seed = Some(number(&mut parser, &option)?),
            "texture-memory" => request.texture_memory = Some(number(&mut parser, &option)?),
            "threads" => request.threads = Some(number(&mut parser, &option)?),
            "crop" => request.crop = Some(numbers(&mut parser, &option, ',', "X0,Y0,X1,Y1")?),
            "sample-range" => request.sample_range = Some(numbers(&mut parser, &option, ':', "A:B")?),
            "strict" => request.strict = true,
            "mmap" => args.mapped = true,
            "stats" => args.stats = Some(parser.value().map_err(wrong)?.into()),
            "quiet" => args.quiet = true,
            _ => return Err(Error::usage(format!("--{option}"), "there is no such option; see --help")),
        }
    }
    let mut positional = positional.into_iter();
    args.scene = positional.next().ok_or_else(|| Error::usage("SCENE", "is missing; see --help"))?;
    args.out = positional.next();
    match positional.next() {
        None => Ok(Command::Render(Box::new(args))),
        Some(extra) => Err(Error::usage(extra.display().to_string(), "is one argument too many; see --help")),
    }
}

/// The parser's own complaint, `missing argument for option '--width'`.
#[expect(clippy::needless_pass_by_value, reason = "the shape that map_err wants")]
fn wrong(error: lexopt::Error) -> Error {
    Error::usage("command line", format!("{error}; see --help"))
}

fn text(parser: &mut lexopt::Parser, option: &str) -> Result<String> {
    parser
        .value()
        .map_err(wrong)?
        .into_string()
        .map_err(|value| Error::usage(format!("--{option}"), format!("{} is not UTF-8", value.display())))
}

fn on_or_off(parser: &mut lexopt::Parser, option: &str) -> Result<bool> {
    match text(parser, option)?.as_str() {
        "on" => Ok(true),
        "off" => Ok(false),
        other => Err(Error::usage(format!("--{option}"), format!("'{other}' is neither on nor off"))),
    }
}

fn number<T: FromStr>(parser: &mut lexopt::Parser, option: &str) -> Result<T> {
    let text = text(parser, option)?;
    text.parse().map_err(|_| Error::usage(format!("--{option}"), format!("'{text}' is no number that fits here")))
}

fn numbers<T: FromStr, const N: usize>(
    parser: &mut lexopt::Parser,
    option: &str,
    separator: char,
    form: &str,
) -> Result<[T; N]> {
    let text = text(parser, option)?;
    let values: Option<Vec<T>> = text.split(separator).map(|part| part.parse().ok()).collect();
    values
        .and_then(|values| values.try_into().ok())
        .ok_or_else(|| Error::usage(format!("--{option}"), format!("'{text}' is not of the form {form}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problem(line: &str) -> String {
        match parse(line.split_whitespace().map(OsString::from)) {
            Err(error) => {
                assert_eq!(error.exit_code(), 2, "{error}");
                error.to_string()
            }
            Ok(_) => panic!("'{line}' must be refused"),
        }
    }

    #[test]
    fn a_full_command_line_becomes_a_request() {
        let line = "s.safetensors --width 320 --aov ior --aov=depth --band 450:650 --crop=-1,0,8,9 out.exr --quiet";
        let Ok(Command::Render(args)) = parse(line.split_whitespace().map(OsString::from)) else {
            panic!("'{line}' is understood")
        };
        assert_eq!(args.scene, PathBuf::from("s.safetensors"));
        assert_eq!(args.out, Some(PathBuf::from("out.exr")));
        assert_eq!(args.request.width, Some(320));
        assert_eq!(args.request.aovs, Some(vec!["ior".to_owned(), "depth".to_owned()]));
        assert_eq!(args.request.band, Some([450.0, 650.0]));
        assert_eq!(args.request.crop, Some([-1, 0, 8, 9]));
        assert!(args.quiet && !args.mapped && !args.request.strict);
    }

    #[test]
    fn what_is_not_understood_is_named() {
        assert_eq!(problem(""), "SCENE: is missing; see --help");
        assert_eq!(problem("a --nonsense"), "--nonsense: there is no such option; see --help");
        assert_eq!(problem("a b c"), "c: is one argument too many; see --help");
        assert_eq!(problem("a --width x"), "--width: 'x' is no number that fits here");
        assert_eq!(problem("a --crop 1,2,3"), "--crop: '1,2,3' is not of the form X0,Y0,X1,Y1");
        assert!(problem("a --width").starts_with("command line: "));
    }
}
