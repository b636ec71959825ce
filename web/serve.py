"""Serves the built page on this machine alone, compressed as hosts of pages do, and prints its address."""

import gzip
import http.server
import pathlib
import sys

TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".wasm": "application/wasm",
}


class Page(http.server.BaseHTTPRequestHandler):
    """Files of one folder, from memory."""

    protocol_version = "HTTP/1.1"
    files = {}

    def do_GET(self):
        """Sends a file, or that there is none."""
        path = self.path.split("?")[0].split("#")[0]
        found = self.files.get("/index.html" if path == "/" else path)
        if found is None:
            self.send_error(404)
            return
        kind, body = found
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Encoding", "gzip")
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-cache")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format, *arguments):
        """Says nothing of files that are there."""


def main():
    """Serves the folder of the first argument at the port of the second, or at any that is free."""
    root = pathlib.Path(sys.argv[1])
    port = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    for path in root.rglob("*"):
        if path.suffix in TYPES:
            name = "/" + path.relative_to(root).as_posix()
            Page.files[name] = TYPES[path.suffix], gzip.compress(path.read_bytes(), 9)
    if "/index.html" not in Page.files:
        sys.exit(f"{root} holds no page: make web builds it")
    try:
        server = http.server.ThreadingHTTPServer(("127.0.0.1", port), Page)
    except OSError as error:
        sys.exit(f"port {port}: {error.strerror}; choose another, as in: make web PORT={port + 1}")
    with server:
        print(f"http://127.0.0.1:{server.server_address[1]}/", flush=True)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            pass


main()
