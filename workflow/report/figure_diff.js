"use strict";
// The new figure lies over the accepted one, up to where the slider is.
for (const slider of document.querySelectorAll("input[type=range]")) {
  const over = slider.closest("figure").querySelector(".over");
  const cut = () => (over.style.clipPath = `inset(0 ${100 - slider.value}% 0 0)`);
  slider.addEventListener("input", cut);
  cut();
}
