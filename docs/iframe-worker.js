// Search without a server: browsers start no worker from a file, so that one runs in a hidden frame.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(script) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      frame.src = "about:blank";
      document.body.append(frame);
      const scope = frame.contentWindow;
      const answer = (data) => {
        const event = new MessageEvent("message", { data });
        this.dispatchEvent(event);
        if (this.onmessage) this.onmessage(event);
      };
      const load = (url) =>
        new Promise((done, failed) => {
          const tag = scope.document.createElement("script");
          tag.src = new URL(url, document.baseURI).href;
          tag.onload = done;
          tag.onerror = failed;
          scope.document.head.append(tag);
        });
      scope.postMessage = answer;
      scope.importScripts = (...urls) => Promise.all(urls.map(load));
      this.scope = scope;
      this.ready = load(script);
    }
    postMessage(data) {
      this.ready.then(() => this.scope.dispatchEvent(new MessageEvent("message", { data })));
    }
    terminate() {
      this.scope.frameElement.remove();
    }
  };
}
