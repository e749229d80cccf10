// The global `THREE` of a page: what the bundle holds of three.js, and no more.
export * from '../bundle/entry.js';
export as namespace THREE;
