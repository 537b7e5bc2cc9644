// Charts are drawn when they come near the screen, and all of them before printing.
(function () {
  var draw = Plotly.newPlot, waiting = new Map();
  function go(id) {
    var call = waiting.get(id);
    if (call) { waiting.delete(id); draw.apply(Plotly, call); }
  }
  if (!("IntersectionObserver" in window)) return;
  var seen = new IntersectionObserver(function (entries) {
    entries.forEach(function (e) {
      if (e.isIntersecting) { seen.unobserve(e.target); go(e.target.id); }
    });
  }, { rootMargin: "800px" });
  Plotly.newPlot = function (id) {
    waiting.set(id, arguments);
    seen.observe(document.getElementById(id));
  };
  window.addEventListener("beforeprint", function () {
    document.querySelectorAll("details").forEach(function (d) { d.open = true; });
    Array.from(waiting.keys()).forEach(go);
  });
})();
