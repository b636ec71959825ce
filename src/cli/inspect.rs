#[derive(clap::Args)]
pub(crate) struct Arguments {
    model: String,
}
pub(crate) fn run(_: &Arguments) -> anyhow::Result<()> {
    Ok(())
}
