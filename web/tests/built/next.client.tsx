/** What Next does in the browser with the pages of `examples/next`: takes over the document that the server has rendered. */

import { hydrateRoot } from 'react-dom/client';
import Layout from '../../examples/next/app/layout';
import Page from '../../examples/next/app/page';

hydrateRoot(document, <Layout><Page /></Layout>, { onRecoverableError: console.error });
