#!/usr/bin/env python3
"""Lists the third-party packages in the program and in the wheel: notices with the licences' texts, or a bill of
materials.

notices.py --notices FILE, or --sbom FILE (CycloneDX 1.5), or --page FILE: notices of the page's module alone, each
under the licence MIT where it has that. The source is Cargo, for this platform, without packages that are only for
builds or tests.
"""

import argparse
import hashlib
import json
import subprocess
import tomllib
import uuid
from pathlib import Path

ROOT = Path(__file__).parents[1]
MANIFESTS = [ROOT / "Cargo.toml", ROOT / "python/Cargo.toml"]
LICENCES = ["LICEN[CS]E*", "COPYING*", "NOTICE*", "UNLICENSE*", "*/COPYING"]
PAGE = ROOT / "wasm/Cargo.toml"
BESIDE = """The program contains the standard library of Rust (MIT OR Apache-2.0, https://github.com/rust-lang/rust), and where it is
static the C library musl (MIT, https://musl.libc.org)."""


def shipped(manifest: Path) -> tuple[dict, list[dict]]:
    """The package of a manifest, and the packages whose code is in its build."""
    host = next(line.split()[1] for line in output("rustc", "-vV").splitlines() if line.startswith("host:"))
    asked = ["cargo", "metadata", "--locked", "--format-version", "1", "--manifest-path", str(manifest)]
    metadata = json.loads(output(*asked, "--filter-platform", host))
    packages = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    root = metadata["resolve"]["root"]
    found, open_ = set(), [root]
    while open_:
        node = open_.pop()
        if node not in found:
            found.add(node)
            for dependency in nodes[node]["deps"]:
                if any(kind["kind"] is None for kind in dependency["dep_kinds"]):
                    open_.append(dependency["pkg"])
    return packages[root], [packages[one] for one in found if packages[one]["source"]]


def output(*command: str) -> str:
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def notices(product: dict, packages: list[dict]) -> str:
    """A line for each package, then each text once, under the names of its packages."""
    lines, owners = [], {}
    for package in packages:
        name = f"{package['name']} {package['version']}"
        origin = package["repository"] or package["homepage"] or "; ".join(package["authors"])
        lines.append(f"{name}: {package['license']}, {origin}")
        folder = Path(package["manifest_path"]).parent
        for file in sorted({file for pattern in LICENCES for file in folder.glob(pattern) if file.is_file()}):
            text = file.read_text(encoding="utf-8", errors="replace").strip()
            owners.setdefault(" ".join(text.split()), (text, []))[1].append(name)
    head = f"{product['name']} {product['version']} contains these packages, each under its own licence.\n{BESIDE}"
    texts = [f"{'=' * 80}\n{', '.join(names)}\n\n{text}" for text, names in owners.values()]
    return "\n\n".join([head, "\n".join(lines), *texts]) + "\n"


def page_notices() -> str:
    """The packages in the page's module, and each text of a licence once, under the copyrights of its packages."""
    tree = ["cargo", "tree", "--locked", "--manifest-path", str(PAGE), "--edges", "normal,no-proc-macro", "--prefix", "none"]
    lines = output(*tree, "--target", "wasm32-unknown-unknown", "--format", "{p}").splitlines()
    names = {tuple(line.split()[:2]) for line in lines}
    asked = ["cargo", "metadata", "--locked", "--format-version", "1", "--manifest-path", str(PAGE)]
    metadata = json.loads(output(*asked, "--filter-platform", "wasm32-unknown-unknown"))
    packages = [one for one in metadata["packages"] if one["source"] and (one["name"], f"v{one['version']}") in names]
    owners = {}
    for package in sorted(packages, key=lambda one: one["name"]):
        folder = Path(package["manifest_path"]).parent
        files = sorted(folder.glob("LICENSE-MIT*")) or sorted({file for one in LICENCES for file in folder.glob(one) if file.is_file()})
        assert files, f"{package['name']} has no text of its licence"
        for file in files:
            head, start, body = file.read_text(encoding="utf-8").partition("Permission is hereby granted")
            copyrights = "; ".join(line.strip() for line in head.splitlines() if line.strip().startswith("Copyright"))
            name = f"{package['name']} {package['version']}, {package['license']}{copyrights and ': ' + copyrights}"
            text = " ".join((start + body if start else head).split())
            owners.setdefault(text, []).append(name)
    head = "pendularm (MIT OR Apache-2.0), copyright of its authors. This file contains the standard library of Rust (MIT OR\n"
    head += "Apache-2.0, https://github.com/rust-lang/rust) and these packages."
    return "\n\n".join([head, *("\n".join([*names, "", text]) for text, names in owners.items())]) + "\n"


def component(package: dict, checksums: dict[tuple[str, str], str]) -> dict:
    name, version = package["name"], package["version"]
    return {
        "type": "library",
        "bom-ref": f"pkg:cargo/{name}@{version}",
        "name": name,
        "version": version,
        "purl": f"pkg:cargo/{name}@{version}",
        "licenses": [{"expression": package["license"].replace("/", " OR ")}],
        "hashes": [{"alg": "SHA-256", "content": checksums[name, version]}],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    wanted = parser.add_mutually_exclusive_group(required=True)
    wanted.add_argument("--notices", type=Path)
    wanted.add_argument("--sbom", type=Path)
    wanted.add_argument("--page", type=Path)
    options = parser.parse_args()
    if options.page:
        options.page.write_text(page_notices(), encoding="utf-8")
        return
    product, packages, checksums = {}, {}, {}
    for manifest in MANIFESTS:
        own, others = shipped(manifest)
        product = product or own
        packages |= {(package["name"], package["version"]): package for package in others}
        locked = tomllib.loads(manifest.with_name("Cargo.lock").read_text(encoding="utf-8"))["package"]
        checksums |= {(one["name"], one["version"]): one["checksum"] for one in locked if "checksum" in one}
    rows = [packages[name] for name in sorted(packages)]
    if options.notices:
        options.notices.write_text(notices(product, rows), encoding="utf-8")
        return
    components = [component(package, checksums) for package in rows]
    known = hashlib.sha256(json.dumps(components).encode()).digest()[:16]
    bill = {
        "$schema": "http://cyclonedx.org/schema/bom-1.5.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "serialNumber": f"urn:uuid:{uuid.UUID(bytes=known, version=4)}",
        "version": 1,
        "metadata": {
            "component": {
                "type": "application",
                "bom-ref": product["name"],
                "name": product["name"],
                "version": product["version"],
                "licenses": [{"expression": product["license"]}],
            }
        },
        "components": components,
    }
    options.sbom.write_text(json.dumps(bill, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
