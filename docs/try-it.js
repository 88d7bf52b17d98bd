// Replaces the picture on the page "Try it in the browser" of the book with a frame that contains the rub.
(() => {
  const link = document.getElementById("try-it");
  if (!link) return;
  const frame = Object.assign(document.createElement("iframe"), { src: link.getAttribute("href"), title: "A rub in the browser" });
  frame.style.cssText = "width: 100%; height: 1400px; border: 0";
  addEventListener("message", event => {
    if (event.source === frame.contentWindow && event.data.height) frame.style.height = `${event.data.height}px`;
  });
  link.replaceWith(frame);
})();
