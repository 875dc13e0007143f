#!/usr/bin/env python3
"""Makes the page one file that needs no server: `scripts/page.py MODULE.wasm NOTICES.txt OUTPUT.html`.

The files of `page/` become one script: each module is a function, in the order of imports, and `pendularm` has their
exports. The script and the WebAssembly module are stored as gzip in base 85.

Invariant: the file makes no network request, and its own policy forbids them.
"""

import base64
import gzip
import pathlib
import re
import sys

PAGE = pathlib.Path(__file__).parent.parent / "page"
MOST_BYTES = 640_000
IMPORT = re.compile(r'^import \{([^}]*)\} from "\./([^"]+)";\n', re.M)
EXPORT = re.compile(r"^export ((?:async )?(?:function|class|const) )(\w+)", re.M)
# Comments that have lines of their own, which the file has no need of.
COMMENT = re.compile(r"^ *(//[^\n]*|/\*\*((?!\*/).)*\*/)\n", re.M | re.S)
POLICY = ("default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval' blob:; worker-src blob:; style-src 'unsafe-inline'; "
          "img-src data: blob:; base-uri 'none'; form-action 'none'")
LOADER = """
unpack(document.querySelector("#page-script").textContent).then((bytes) => {
  const script = document.createElement("script");
  script.textContent = new TextDecoder().decode(bytes);
  document.head.append(script);
});
"""


# The digits of base 85: those of Python, and those of `page/packed.js`, which end no script.
DIGITS = bytes.maketrans(b"0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%&()*+-;<=>?@^_`{|}~",
                         bytes(code for code in range(40, 126) if code != ord("<")))


def packed(data):
    return base64.b85encode(gzip.compress(data, 9, mtime=0)).translate(DIGITS).decode()


def modules(name, done, above=()):
    """The module after its imports, each as a function that returns its exports."""
    if name in above:
        raise SystemExit(f"page.py: a circle of imports, {' '.join(above)} {name}")
    if name in done:
        return ""
    done.add(name)
    text = COMMENT.sub("", (PAGE / name).read_text())
    before = "".join(modules(other, done, (*above, name)) for _, other in IMPORT.findall(text))
    imported = lambda found: f'const {{{found[1].replace(" as ", ": ")}}} = pendularm["{found[2]}"];\n'
    body = EXPORT.sub(r"\1\2", IMPORT.sub(imported, text))
    if re.search(r"^(import|export)\b", body, re.M):
        raise SystemExit(f"page.py: {name} imports or exports in a way that is not known here")
    exported = ", ".join(name for _, name in EXPORT.findall(text))
    return f'{before}pendularm["{name}"] = (() => {{\n{body}\nreturn {{ {exported} }};\n}})();\n'


def replaced(text, old, new):
    if old not in text:
        raise SystemExit(f"page.py: index.html has no {old}")
    return text.replace(old, new)


def main(module, notices, output):
    script = '"use strict";\nconst pendularm = globalThis.pendularm = {};\n' + modules("main.js", set())
    icon = "data:image/svg+xml;base64," + base64.b64encode((PAGE / "icon.svg").read_bytes()).decode()
    text = (PAGE / "index.html").read_text()
    text = replaced(text, '<meta charset="utf-8">', f'<meta charset="utf-8">\n  <meta http-equiv="Content-Security-Policy" content="{POLICY}">')
    licences = pathlib.Path(notices).read_text()
    if "-->" in licences:
        raise SystemExit(f"page.py: {notices} has the end of a comment")
    text = replaced(text, "</html>", f"</html>\n<!--\n{licences}-->")
    text = replaced(text, '"icon.svg"', f'"{icon}"')
    style = re.sub(r"/\*.*?\*/\s*", "", (PAGE / "style.css").read_text(), flags=re.S)
    text = replaced(text, '<link rel="stylesheet" href="style.css">', f"<style>\n{style}</style>")
    text = replaced(text, '  <script type="module" src="main.js"></script>\n', "")
    unpack = COMMENT.sub("", (PAGE / "packed.js").read_text()).replace("export ", "")
    carried = {"page-script": script.encode(), "kernel-module": pathlib.Path(module).read_bytes()}
    scripts = "".join(f'<script type="text/plain" id="{name}">{packed(data)}</script>\n' for name, data in carried.items())
    text = replaced(text, "</body>", f"{scripts}<script>{unpack}{LOADER}</script>\n</body>")
    pathlib.Path(output).write_text(text)
    size = len(text.encode())
    print(f"page.py: {output}, {size} bytes")
    if size > MOST_BYTES:
        raise SystemExit(f"page.py: more than {MOST_BYTES} bytes")


main(*sys.argv[1:])
