// The page: a viewer that fills the window. The page's address sets the scene.
//
//   ?url=ADDRESS              the .strivec file; another server must allow it (CORS)
//   &camera=16[,1] NUMBERS    a row-major camera-to-world matrix in the dataset's space, and the vertical angle in degrees
//   &compare=ADDRESS          a file to compare it with
//   &quality=NAME             quality setting stored in the file: fast, balanced or best
//   &data=ADDRESS             the dataset's transforms_train.json, for its photographs

import { escaped } from "./dom";
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
    document.title = `${escaped(viewer.name)} – Strivec`;
  });
}
