// Plays the films of all layouts at the same moment. A film is an <img data-film="folder/"
// data-count="frames written so far">; one slider and one button control all of them.
(() => {
  const PERIOD_MS = 95;
  const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  const state = { frame: 0, playing: !still };
  const kept = new Map();

  function source(film, number) {
    return `${film}${String(number).padStart(3, "0")}.jpg`;
  }

  function fetchAhead(film, count) {
    if (!kept.has(film)) kept.set(film, []);
    const frames = kept.get(film);
    for (let number = frames.length; number < count; number += 1) {
      const frame = new Image();
      frame.src = source(film, number);
      frames.push(frame);
    }
  }

  function films() {
    return [...document.querySelectorAll("img[data-film]")];
  }

  function show() {
    for (const image of films()) {
      const count = Number(image.dataset.count) || 0;
      if (count === 0) continue;
      fetchAhead(image.dataset.film, count);
      const wanted = source(image.dataset.film, Math.min(state.frame, count - 1));
      if (image.getAttribute("src") !== wanted) image.setAttribute("src", wanted);
    }
    for (const slider of document.querySelectorAll("input[data-film-slider]")) {
      slider.max = String(Math.max(last(), 1));
      if (document.activeElement !== slider || state.playing) slider.value = String(state.frame);
    }
    for (const button of document.querySelectorAll("[data-film-play]")) {
      button.textContent = state.playing ? "\u275a\u275a pause" : "\u25b6 play";
    }
  }

  function last() {
    return Math.max(0, ...films().map((image) => (Number(image.dataset.count) || 1) - 1));
  }

  document.addEventListener("click", (event) => {
    if (!event.target.closest("[data-film-play]")) return;
    state.playing = !state.playing;
    if (state.playing && state.frame >= last()) state.frame = 0;
    show();
  });
  document.addEventListener("input", (event) => {
    if (!event.target.matches("input[data-film-slider]")) return;
    state.playing = false;
    state.frame = Number(event.target.value);
    show();
  });
  window.blastEnvRewind = () => {
    state.frame = 0;
    state.playing = !still;
  };
  setInterval(() => {
    if (state.playing && films().length > 0) state.frame = state.frame >= last() ? 0 : state.frame + 1;
    show();
  }, PERIOD_MS);
})();
