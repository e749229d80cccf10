// Packages that only their own folders install, as far as they are used.
declare module 'gltf-validator';
declare module 'esbuild';
declare module '@sparticuz/chromium';
