"use strict";
// Left of the slider is the accepted figure, right of it the new one.
for (const slider of document.querySelectorAll("input[type=range]")) {
  const over = slider.closest("figure").querySelector(".over");
  const cut = () => (over.style.clipPath = `inset(0 0 0 ${slider.value}%)`);
  slider.addEventListener("input", cut);
  cut();
}
