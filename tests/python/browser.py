"""Open a page in Chromium (Qt WebEngine) without a screen, run JavaScript in it, and print the results as JSON.

    python browser.py PAGE WIDTH HEIGHT light|dark EXPRESSION... [--shot FILE]

The page counts as loaded when `READY` is true in it. Each expression is a function body that may return a value. The next
expression runs after the page has had time to draw and `READY` is true again. Exit code 77: no browser can run here; the last line on stderr is the reason.
"""

import json
import os
import sys

os.environ["QT_QPA_PLATFORM"] = "offscreen"
os.environ["QT_LOGGING_RULES"] = "*=false"
# Software rendering, also for WebGL; the sandbox needs privileges that containers do not have.
os.environ["QTWEBENGINE_DISABLE_SANDBOX"] = "1"
os.environ["QTWEBENGINE_CHROMIUM_FLAGS"] = "--use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader --ignore-gpu-blocklist --log-level=3"
# Blink's numbers for dark and light.
os.environ["QTWEBENGINE_CHROMIUM_FLAGS"] += f" --blink-settings=preferredColorScheme={0 if 'dark' in sys.argv[4:5] else 1}"
READY = "document.readyState === 'complete' && (!document.getElementById('viewer') || document.getElementById('viewer').dataset.ready === 'true' || !document.querySelector('.note').hidden) && document.body.dataset.busy !== 'true'"
UNAVAILABLE = 77
#: Longest duration of a session (ms).
TIMEOUT = 110_000

try:
    from PySide6.QtCore import QTimer, QUrl
    from PySide6.QtWebEngineCore import QWebEnginePage
    from PySide6.QtWebEngineWidgets import QWebEngineView
    from PySide6.QtWidgets import QApplication
except ImportError as error:
    print(f"Qt WebEngine cannot be loaded: {error}", file=sys.stderr)
    sys.exit(UNAVAILABLE)


class Page(QWebEnginePage):
    """Page that collects its console messages."""

    def __init__(self, view):
        super().__init__(view)
        self.messages = []

    def javaScriptConsoleMessage(self, level, message, line, source):
        self.messages.append({"level": level.name, "text": message, "line": line})


class Session:
    """Loads the page, runs the expressions one after the other, and ends."""

    def __init__(self, application, path, width, height, shot, expressions):
        self.application, self.shot, self.expressions, self.results = application, shot, list(expressions), []
        self.view = QWebEngineView()
        self.page = Page(self.view)
        self.view.setPage(self.page)
        self.view.resize(width, height)
        self.view.show()
        self.page.loadFinished.connect(self.loaded)
        self.page.load(QUrl.fromLocalFile(os.path.abspath(path)))
        QTimer.singleShot(TIMEOUT, lambda: self.end("timeout"))

    def loaded(self, succeeded):
        if not succeeded:
            self.end("the page cannot be loaded")
        else:
            self.wait()

    def wait(self):
        self.page.runJavaScript(READY, lambda ready: QTimer.singleShot(150, self.next if ready else self.wait))

    def next(self):
        if not self.expressions:
            QTimer.singleShot(300, self.finish)
            return
        body = self.expressions.pop(0)
        self.page.runJavaScript(f"JSON.stringify((() => {{ {body} }})() ?? null)", self.take)

    def take(self, value):
        self.results.append(json.loads(value) if value else None)
        QTimer.singleShot(100, self.wait)

    def finish(self):
        if self.shot:
            self.view.grab().save(self.shot)
        self.end(None)

    def end(self, problem):
        print(json.dumps({"problem": problem, "results": self.results, "console": self.page.messages}), flush=True)
        self.application.quit()


def main():
    arguments = sys.argv[1:]
    shot = None
    # A picture for people who look at the page.
    if "--shot" in arguments:
        at = arguments.index("--shot")
        shot = arguments[at + 1]
        del arguments[at : at + 2]
    path, width, height, _, *expressions = arguments
    application = QApplication([sys.argv[0]])
    # Without this variable, Python would free the session.
    session = Session(application, path, int(width), int(height), shot, expressions)
    application.exec()
    assert session
    # Exit without waiting for the threads of Chromium.
    sys.stdout.flush()
    os._exit(0)


main()
