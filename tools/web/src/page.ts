// The page: a viewer that fills the window, and shows what the page's address names.
//
//   ?url=ADDRESS              the .strivec file; elsewhere than here, its server must allow it (CORS)
//   &camera=16[,1] NUMBERS    a row-major camera-to-world matrix in the dataset's space, and the degrees from top to bottom
//   &compare=ADDRESS          a file to compare it with
//   &quality=NAME             a way to draw that the file names: fast, balanced or best
//   &data=ADDRESS             the dataset's transforms_train.json, for its photographs

import { StrivecViewer } from "./index";

const viewer = document.querySelector("strivec-viewer");
if (viewer instanceof StrivecViewer) {
  const search = new URLSearchParams(location.search);
  for (const [parameter, attribute] of [
    ["camera", "camera"],
    ["url", "src"],
    ["compare", "compare"],
    ["quality", "quality"],
    ["data", "data"],
  ] as const) {
    const value = search.get(parameter);
    if (value) viewer.setAttribute(attribute, value);
  }
  viewer.addEventListener("open", () => {
    document.title = `${viewer.name} – Strivec`;
  });
}
