"""What `pip install polhode` brings on other platforms, as uv resolves it from wheels."""

from versions.tools import PYTHONS, Found, uv

# Platforms by uv's names.
PLATFORMS = {
    "Linux, x86-64": "x86_64-manylinux_2_28",
    "Linux, ARM": "aarch64-manylinux_2_28",
    "macOS, ARM": "aarch64-apple-darwin",
    "macOS, x86-64": "x86_64-apple-darwin",
    "Windows, x86-64": "x86_64-pc-windows-msvc",
}


def on_platform(platform: str) -> Found:
    """The versions that a platform gets, by package; or "why" it gets none."""
    words = ["pip", "compile", "--quiet", "--no-header", "--no-annotate"]
    words += ["--only-binary", ":all:", "--python-version", PYTHONS[0]]
    words += ["--python-platform", PLATFORMS[platform], "pyproject.toml"]
    try:
        found = uv(*words)
    except RuntimeError as error:
        return {"why": str(error)}
    return dict(line.split("==") for line in found.splitlines() if "==" in line)
