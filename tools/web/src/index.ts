// The custom element <strivec-viewer>, for any page.

import { StrivecViewer } from "./element";

export { StrivecViewer };

if (!customElements.get("strivec-viewer")) customElements.define("strivec-viewer", StrivecViewer);

declare global {
  interface HTMLElementTagNameMap {
    "strivec-viewer": StrivecViewer;
  }
}
