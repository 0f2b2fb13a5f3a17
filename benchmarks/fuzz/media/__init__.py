"""Media with damaged packets: from cameras through the splice, in files, and as a client reads them."""
