// The page: a viewer that fills the window, and shows what the page's address names.
//
//   ?url=ADDRESS              the .strivec file; elsewhere than here, its server must allow it (CORS)
//   &camera=16[,1] NUMBERS    a row-major camera-to-world matrix in the dataset's space, and the degrees from top to bottom

import { StrivecViewer } from "./index";

const viewer = document.querySelector("strivec-viewer");
if (viewer instanceof StrivecViewer) {
  const search = new URLSearchParams(location.search);
  const [url, camera] = [search.get("url"), search.get("camera")];
  if (camera) viewer.setAttribute("camera", camera);
  if (url) viewer.setAttribute("src", url);
  viewer.addEventListener("open", () => {
    document.title = `${viewer.name} – Strivec`;
  });
}
